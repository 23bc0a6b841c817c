#include "firmware/calibration/calibration_keeper.h"

#include <algorithm>
#include <new>

#include "firmware/calibration/rehearsal.h"
#include "firmware/frame/drain.h"
#include "protocol/base/try.h"
#include "stitch/sets/rig_heads.h"

namespace nodal::firmware {
namespace {

constexpr std::size_t kRequests = 32;  // one per host

Error out_of_memory(const Sha256& id) {
  return {Errc::kOverload,
          "the board has not enough memory to compile the table of calibration " + short_id(id) +
              "; make the raymap in rig.toml smaller, or raise nodald's limit (ulimit -v, MemoryMax=)"};
}

}  // namespace

Result<Calibration> fit_to_rig(const Calibration& calibration, const std::vector<HeadConfig>& rig,
                               const HeadShapes& heads) {
  std::vector<sets::RigHead> named;
  for (std::size_t i = 0; i < rig.size(); ++i) {
    sets::RigHead& head = named.emplace_back(sets::RigHead{rig[i].name, {}});
    if (i < heads.size() && heads[i]) head.size = {heads[i]->width, heads[i]->height};
  }
  return sets::calibration_of(calibration, named, "rig.toml");
}

std::vector<PixelFormat> delivered_formats(const RigConfig& config, const HeadShapes& heads) {
  std::vector<PixelFormat> formats;
  for (std::size_t i = 0; i < config.heads.size(); ++i)
    formats.push_back(i < heads.size() && heads[i] ? heads[i]->format : config.heads[i].format);
  return formats;
}

CalibrationKeeper::CalibrationKeeper(const RigConfig& config, hal::DiskPort& disk,
                                     SpscRing<sets::BlendSetup>& tables_out, SpscRing<sets::BlendSetup>& tables_back,
                                     hal::ConfinedPort* rehearsal)
    : config_(config),
      disk_(disk),
      tables_out_(tables_out),
      tables_back_(tables_back),
      requests_(kRequests),
      answers_(kRequests),
      rehearsal_(rehearsal) {
  report_.activity = "reading the calibration store";  // before the first step(), for hosts that connect early
  publish();
}

bool CalibrationKeeper::step(Instant now) {
  now_ = now;
  bool busy = drain(tables_back_, [](auto) {});  // frees old tables here, outside the frame path
  if (!started_) {
    started_ = true;
    load_at_start();
    busy = true;
  } else if (installing_) {
    busy |= compile_within_memory();
  } else if (!to_try_.empty()) {
    start_next_good();
    busy = true;
  }
  busy |= watch_trial();
  busy |= take_requests();
  if (busy) publish();
  return busy;
}

/// When the allocation of a new table fails, only its request fails; the calibration in force stays.
bool CalibrationKeeper::compile_within_memory() {
  try {
    return compile_some();
  } catch (const std::bad_alloc&) {
    end(fail(out_of_memory(installing_->id)));
    return true;
  }
}

void CalibrationKeeper::load_at_start() {
  auto opened = CalibrationStore::open(disk_);
  if (!opened) {
    store_status_ = fail(opened.error().in("calibration store"));
    report_.problem = store_status_.error().message;
    report_.activity.clear();
    report_.ready = true;
    return;
  }
  store_.emplace(std::move(*opened));
  report_.problem = store_->note();
  const auto in_force = store_->in_force();
  for (auto entry = store_->entries().rbegin(); entry != store_->entries().rend(); ++entry) {
    if (entry->id != in_force) to_try_.push_back(*entry);
  }
  for (const CalibrationStore::Entry& entry : store_->entries()) {
    if (entry.id == in_force) to_try_.push_back(entry);
  }
  report_.ready = to_try_.empty();
  if (report_.ready) report_.activity.clear();
}

/// Tries the calibration in force; if it does not fit the rig any more, the other ones, newest first.
void CalibrationKeeper::start_next_good() {
  const CalibrationStore::Entry entry = to_try_.back();
  to_try_.pop_back();
  auto loaded = load_permitted(*store_, signature_rules(), entry.id);
  Status begun =
      loaded ? begin(std::nullopt, std::move(loaded->calibration), entry.id, false, {}) : Status(fail(loaded.error()));
  if (!begun) end(begun);
}

/// Answers all queries at once, whatever is being installed; a change waits until the current installation has ended.
bool CalibrationKeeper::take_requests() {
  bool busy = false;
  for (std::size_t taken = 0; taken < requests_.capacity() && !answers_.full(); ++taken) {
    std::optional<CalibrationRequest> request = requests_.pop();
    if (!request) break;
    busy = true;
    if (answer_at_once(*request)) continue;
    NODAL_ASSERT(!waiting_);  // control sends one change at a time
    waiting_ = std::move(request);
  }
  const bool changing = installing_ || !to_try_.empty();
  if (!waiting_ || changing || answers_.full()) return busy;
  const CalibrationRequest request = *std::exchange(waiting_, std::nullopt);
  if (request.host.gone()) answer(request.ticket, fail(Presence::error()));
  else if (Status begun = start(request); !begun) answer(request.ticket, fail(begun.error()));
  return true;
}

bool CalibrationKeeper::answer_at_once(const CalibrationRequest& request) {
  if (request.host.gone()) {
    answer(request.ticket, fail(Presence::error()));
  } else if (!store_) {
    answer(request.ticket, fail(store_status_.error()));
  } else if (std::holds_alternative<CalibrationRequest::List>(request.what)) {
    answer(request.ticket, list());
  } else if (const auto* wanted = std::get_if<CalibrationRequest::Get>(&request.what)) {
    answer(request.ticket, get(wanted->id_prefix));
  } else {
    return false;
  }
  return true;
}

Status CalibrationKeeper::start(const CalibrationRequest& request) {
  if (const auto* how = std::get_if<CalibrationRequest::EndTrial>(&request.what)) return end_trial(request, *how);
  if (trial_.running()) {
    if (std::holds_alternative<CalibrationRequest::Rollback>(request.what)) return end_trial(request, {});
    return fail(Errc::kBusy, "calibration " + short_id(trial_.report().id) + " is on trial for another " +
                                 std::to_string((trial_.report().until - now_).ms() / 1000) +
                                 " s; wait, or end the trial with `nodal calibration rollback`");
  }
  if (std::holds_alternative<CalibrationRequest::Install>(request.what))
    return rehearsal_ ? rehearse(request) : install(request);
  if (const auto* wanted = std::get_if<CalibrationRequest::Use>(&request.what)) {
    const auto found = store_->find(wanted->id_prefix);
    return found ? use(request, found->id, wanted->allow_older) : Status(fail(found.error()));
  }
  if (store_->before()) return use(request, Sha256(*store_->before()), true);  // a rollback is to an older one
  return fail(Errc::kNotFound, "no earlier calibration is stored that the rig could go back to");
}

Status CalibrationKeeper::install(const CalibrationRequest& request) {
  const auto& upload = std::get<CalibrationRequest::Install>(request.what);
  const auto permitted = check_signature(signature_rules(), {upload.signature, upload.json});
  if (!permitted) return fail(permitted.error().in("calibration"));
  auto calibration = parse_calibration(upload.json);
  if (!calibration) return fail(calibration.error().in("calibration"));
  const Sha256 id = calibration_id(*calibration);
  const bool known = store_->read(id).has_value();
  const bool had = has_signature(*store_, signature_rules(), id, *permitted);
  if (Status newest = check_generation(signature_rules(), *permitted, had); !newest && !upload.allow_older) {
    return fail(newest.error().in("calibration"));
  }
  NODAL_TRY(fit_to_rig(*calibration, config_.heads, request.heads));
  std::optional<SignedDocument> original;
  if (config_.signers) original = SignedDocument{upload.signature, upload.json};
  if (upload.trial) return install_on_trial(request, std::move(*calibration), std::move(original), *upload.trial);
  if (auto stored = store_->put(*calibration, original); !stored) {
    return fail(stored.error().in("storing calibration " + short_id(id)));
  }
  Status begun = begin(request.ticket, std::move(*calibration), id, !known, request.heads, permitted->generation);
  if (!begun && !known) store_->remove(id);
  return begun;
}

Status CalibrationKeeper::install_on_trial(const CalibrationRequest& request, Calibration calibration,
                                           std::optional<SignedDocument> original, Duration trial) {
  const Sha256 id = calibration_id(calibration);
  if (!running_) {
    return fail(Errc::kWrongState,
                "no calibration is in force that the rig could go back to after a trial; upload without a trial");
  }
  if (id == running_.plan->id) return fail(Errc::kExists, "calibration " + short_id(id) + " is in force already");
  NODAL_TRY(begin(request.ticket, calibration, id, false, request.heads));
  installing_->on_trial = true;
  trial_.prepare(std::move(calibration), std::move(original), running_, trial);
  return {};
}

/// Keeping fails when the disk fails; then the trial continues, and at its end the rig goes back.
Status CalibrationKeeper::end_trial(const CalibrationRequest& request, const CalibrationRequest::EndTrial& how) {
  if (!trial_.running()) {
    return fail(Errc::kWrongState, "no calibration is on trial; the trial has ended");
  }
  const Sha256 id = trial_.report().id;
  if (!std::string_view(reinterpret_cast<const char*>(id.data()), id.size()).starts_with(how.id_prefix)) {
    return fail(Errc::kNotFound, "the calibration on trial is " + short_id(id) + ", which has another id");
  }
  if (!how.keep) {
    go_back(request.ticket);
    return {};
  }
  const bool known = store_->read(id).has_value();
  if (auto stored = store_->put(trial_.calibration(), trial_.original()); !stored) {
    return fail(stored.error().in("storing calibration " + short_id(id)));
  }
  const auto permitted = check_signature(signature_rules(), trial_.original().value_or(SignedDocument{}));
  Status kept = permitted ? store_->note_signed(permitted->generation) : Status(fail(permitted.error()));
  if (kept) kept = store_->set_in_force(id);
  if (!kept) {
    if (!known) store_->remove(id);
    return fail(kept.error().in("putting calibration " + short_id(id) + " in force"));
  }
  trial_.keep();
  report_.trial.reset();
  report_.problem.clear();
  answer(request.ticket, CalibrationAnswer::Done{});
  return {};
}

/// Goes back to the old calibration when the time of a trial is over.
bool CalibrationKeeper::watch_trial() {
  if (installing_ || !trial_.overdue(now_)) return false;
  go_back(std::nullopt);
  return true;
}

/// Gives the old calibration to the blend. A ticket is answered when the blend has taken it.
void CalibrationKeeper::go_back(std::optional<std::uint64_t> ticket) {
  sets::BlendSetup before = trial_.go_back();
  report_.in_force = before.plan->id;
  report_.name = before.plan->name;
  report_.document = document_before_trial_;
  report_.trial.reset();
  hand_over(std::move(before));
  Installation back;
  back.ticket = ticket;
  back.id = running_.plan->id;
  back.handed_over = true;
  installing_.emplace(std::move(back));
}

void CalibrationKeeper::hand_over(sets::BlendSetup setup) {
  running_ = setup;
  const bool pushed = tables_out_.push(std::move(setup));
  NODAL_ASSERT(pushed);
}

Status CalibrationKeeper::use(const CalibrationRequest& request, const Sha256& id, bool allow_older) {
  NODAL_TRY_ASSIGN(auto loaded, load_permitted(*store_, signature_rules(), id));
  if (const Status newest = check_generation(signature_rules(), loaded.permitted, true); !newest && !allow_older) {
    return fail(newest.error().in("stored calibration " + short_id(id)));
  }
  return begin(request.ticket, std::move(loaded.calibration), id, false, request.heads, loaded.permitted.generation);
}

Status CalibrationKeeper::begin(std::optional<std::uint64_t> ticket, Calibration calibration, const Sha256& id,
                                bool newly_stored, const HeadShapes& heads, std::uint64_t generation) {
  NODAL_TRY_ASSIGN(auto fitted, fit_to_rig(calibration, config_.heads, heads));
  try {
    auto job = plan_within_budget(fitted, config_, heads);
    if (!job) return fail(job.error().in("calibration " + short_id(id)));
    installing_.emplace(Installation{ticket, id, newly_stored, std::move(*job), false, false,
                                     std::make_shared<const std::string>(canonical_json(calibration)), generation});
  } catch (const std::bad_alloc&) {
    return fail(out_of_memory(id));
  }
  return {};
}

bool CalibrationKeeper::compile_some() {
  Installation& now = *installing_;
  if (now.rehearsed) return !answers_.full() && end_rehearsal();
  if (now.job && !now.job->tables().done()) {
    sets::TableJob& tables = now.job->tables();
    tables.compile_some(kRowsAStep);
    report_.activity =
        "compiling the table of calibration " + short_id(now.id) + ": " + std::to_string(tables.percent()) + " %";
    return true;
  }
  if (tables_out_.full() || answers_.full()) return false;  // the blend has not taken the table yet
  if (now.handed_over) {
    end({});
  } else if (const Status status = put_in_force(now); !status) {
    end(status);
  }
  return true;
}

Status CalibrationKeeper::put_in_force(Installation& done) {
  auto plan = std::move(*done.job).finish(done.id);
  if (!plan) return fail(plan.error().in("calibration " + short_id(done.id)));
  // Allocates everything before the disk changes, so that a failed allocation leaves the disk as it was.
  sets::BlendSetup setup = sets::with_memory(std::move(*plan));
  // At start the pointer on the disk is right already, unless a damaged calibration was skipped; then it is rewritten.
  if (!done.on_trial && (done.ticket || store_->in_force() != done.id || !store_->note().empty())) {
    Status kept = store_->note_signed(done.signed_generation);
    if (kept) kept = store_->set_in_force(done.id);
    if (!kept) {
      if (done.ticket) return fail(kept.error().in("putting calibration " + short_id(done.id) + " in force"));
      report_.problem = kept.error().message;  // it stays in force, but only until the next start
    }
  }
  if (done.on_trial) document_before_trial_ = report_.document;
  report_.document = done.document;
  report_.in_force = done.id;
  report_.name = setup.plan->name;
  if (done.on_trial) {
    trial_.run(now_);
    report_.trial = trial_.report();
  }
  hand_over(std::move(setup));
  done.handed_over = true;
  return {};
}

void CalibrationKeeper::end(const Status& status) {
  const bool at_start = !installing_ || !installing_->ticket;
  report_.activity.clear();
  if (at_start) {
    report_.ready = status.has_value() || to_try_.empty();
    if (status) {
      to_try_.clear();
    } else {
      if (!report_.problem.empty()) report_.problem += "; ";
      report_.problem += status.error().message;
    }
  } else {
    if (!status && installing_->newly_stored) store_->remove(installing_->id);
    if (!status && installing_->on_trial) trial_.give_up();
    if (status && !installing_->on_trial) report_.problem.clear();
    Result<Answered> result = CalibrationAnswer::Done{};
    if (!status) result = fail(status.error());
    answer(*installing_->ticket, std::move(result));
  }
  installing_.reset();
}

void CalibrationKeeper::answer(std::uint64_t ticket, Result<Answered> result) {
  if (result) {
    if (auto* done = std::get_if<CalibrationAnswer::Done>(&*result)) done->in_force = report_.in_force;
  }
  const bool pushed = answers_.push(CalibrationAnswer{ticket, std::move(result)});
  NODAL_ASSERT(pushed);
}

void CalibrationKeeper::publish() { snapshot_.publish(report_); }

}  // namespace nodal::firmware
