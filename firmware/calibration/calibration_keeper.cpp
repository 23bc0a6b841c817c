#include "firmware/calibration/calibration_keeper.h"

#include <fmt/format.h>

#include <algorithm>
#include <new>

#include "firmware/calibration/rehearsal.h"
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

Result<CalibrationAnswer::Document> document_of(const std::string& id_prefix, const PermittedStore& store,
                                                const std::optional<Sha256>& in_force, const CalibrationTrial& trial) {
  if (id_prefix.empty() && !in_force) return fail(Errc::kNotFound, "no calibration is in force");
  Sha256 id{};
  if (id_prefix.empty()) {
    id = *in_force;
  } else {
    NODAL_TRY_ASSIGN(const auto found, store.contents().find(id_prefix));
    id = found.id;
  }
  if (trial.running() && id == trial.report().id)
    return CalibrationAnswer::Document{id, canonical_json(trial.calibration())};
  NODAL_TRY_ASSIGN(auto json, store.contents().read(id));
  return CalibrationAnswer::Document{id, std::move(json)};
}

CalibrationAnswer::Listed list_of(const PermittedStore& store, const KeeperReport& report,
                                  const CalibrationTrial& trial) {
  CalibrationAnswer::Listed listed{store.contents().entries(), report.in_force, std::nullopt,
                                   store.signed_generation()};
  if (trial.running()) {
    listed.on_trial.emplace(
        CalibrationStore::Entry{0, trial.report().id, report.name, trial.calibration().heads.size(), ""});
  }
  return listed;
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
      tables_(tables_out, tables_back),
      requests_(kRequests),
      answers_(kRequests),
      rehearsal_(rehearsal),
      store_(config_.signers, config_.name) {
  report_.activity = "reading the calibration store";  // before the first step(), for hosts that connect early
  snapshot_.publish(report_);
}

bool CalibrationKeeper::step(Instant now) {
  now_ = now;
  bool busy = tables_.free_old();
  if (!started_) {
    started_ = true;
    load_at_start();
    busy = true;
  } else if (installing_) {
    try {
      busy |= compile_some();
    } catch (const std::bad_alloc&) {  // only this request fails; the calibration in force stays
      end(fail(out_of_memory(installing_->id)));
      busy = true;
    }
  } else if (!to_try_.empty()) {
    start_next_good();
    busy = true;
  }
  if (!installing_ && trial_.overdue(now)) {
    go_back(std::nullopt);
    busy = true;
  }
  busy |= take_requests();
  if (busy) snapshot_.publish(report_);
  return busy;
}

void CalibrationKeeper::load_at_start() {
  if (const Status opened = store_.open(disk_); !opened) {
    report_.problem = opened.error().message;
    report_.activity.clear();
    report_.ready = true;
    return;
  }
  const CalibrationStore& stored = store_.contents();
  report_.problem = stored.note();
  const auto in_force = stored.in_force();
  for (auto entry = stored.entries().rbegin(); entry != stored.entries().rend(); ++entry) {
    if (entry->id != in_force) to_try_.push_back(*entry);
  }
  for (const CalibrationStore::Entry& entry : stored.entries()) {
    if (entry.id == in_force) to_try_.push_back(entry);
  }
  report_.ready = to_try_.empty();
  if (report_.ready) report_.activity.clear();
}

/// Tries the calibration in force; if it does not fit the rig any more, the other ones, newest first.
void CalibrationKeeper::start_next_good() {
  const CalibrationStore::Entry entry = to_try_.back();
  to_try_.pop_back();
  auto loaded = store_.load(entry.id, true);
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
  } else if (!store_.status()) {
    answer(request.ticket, fail(store_.status().error()));
  } else if (std::holds_alternative<CalibrationRequest::List>(request.what)) {
    answer(request.ticket, list_of(store_, report_, trial_));
  } else if (const auto* wanted = std::get_if<CalibrationRequest::Get>(&request.what)) {
    answer(request.ticket, document_of(wanted->id_prefix, store_, report_.in_force, trial_));
  } else {
    return false;
  }
  return true;
}

Status CalibrationKeeper::start(const CalibrationRequest& request) {
  if (const auto* how = std::get_if<CalibrationRequest::EndTrial>(&request.what)) return end_trial(request, *how);
  if (trial_.running()) {
    if (std::holds_alternative<CalibrationRequest::Rollback>(request.what)) return end_trial(request, {});
    return fail(
        Errc::kBusy,
        fmt::format(
            "calibration {} is on trial for another {} s; wait, or end the trial with `nodal calibration rollback`",
            short_id(trial_.report().id), (trial_.report().until - now_).ms() / 1000));
  }
  if (std::holds_alternative<CalibrationRequest::Install>(request.what))
    return rehearsal_ ? rehearse(request) : install(request);
  Sha256 id{};
  bool allow_older = true;  // a rollback is to an older one
  if (const auto* wanted = std::get_if<CalibrationRequest::Use>(&request.what)) {
    NODAL_TRY_ASSIGN(const auto found, store_.contents().find(wanted->id_prefix));
    id = found.id;
    allow_older = wanted->allow_older;
  } else if (const auto before = store_.contents().before()) {
    id = *before;
  } else {
    return fail(Errc::kNotFound, "no earlier calibration is stored that the rig could go back to");
  }
  NODAL_TRY_ASSIGN(auto loaded, store_.load(id, allow_older));
  return begin(request.ticket, std::move(loaded.calibration), id, false, request.heads, loaded.permitted.generation);
}

Status CalibrationKeeper::install(const CalibrationRequest& request) {
  const auto& upload = std::get<CalibrationRequest::Install>(request.what);
  NODAL_TRY_ASSIGN(auto accepted, store_.accept({upload.signature, upload.json}, upload.allow_older));
  const Sha256 id = accepted.id;
  NODAL_TRY(fit_to_rig(accepted.calibration, config_.heads, request.heads));
  if (upload.trial) {
    const sets::BlendSetup& before = tables_.newest();
    if (!before) {
      return fail(Errc::kWrongState,
                  "no calibration is in force that the rig could go back to after a trial; upload without a trial");
    }
    if (id == before.plan->id) return fail(Errc::kExists, "calibration " + short_id(id) + " is in force already");
    NODAL_TRY(begin(request.ticket, accepted.calibration, id, false, request.heads));
    installing_->on_trial = true;
    trial_.prepare(std::move(accepted.calibration), std::move(accepted.original), before, *upload.trial);
    return {};
  }
  NODAL_TRY(store_.put(accepted.calibration, accepted.original));
  Status begun =
      begin(request.ticket, std::move(accepted.calibration), id, !accepted.stored, request.heads, accepted.generation);
  if (!begun && !accepted.stored) store_.remove(id);
  return begun;
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
  NODAL_TRY(store_.keep(trial_.calibration(), trial_.original()));
  trial_.keep();
  report_.trial.reset();
  report_.problem.clear();
  answer(request.ticket, CalibrationAnswer::Done{});
  return {};
}

/// Gives the old calibration to the blend. A ticket is answered when the blend has taken it.
void CalibrationKeeper::go_back(std::optional<std::uint64_t> ticket) {
  sets::BlendSetup before = trial_.go_back();
  report_.in_force = before.plan->id;
  report_.name = before.plan->name;
  report_.document = document_before_trial_;
  report_.trial.reset();
  tables_.give(std::move(before));
  Installation back;
  back.ticket = ticket;
  back.id = tables_.newest().plan->id;
  back.handed_over = true;
  installing_.emplace(std::move(back));
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
    report_.activity = fmt::format("compiling the table of calibration {}: {} %", short_id(now.id), tables.percent());
    return true;
  }
  if (!tables_.room() || answers_.full()) return false;  // the blend has not taken the table yet
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
  if (!done.on_trial && (done.ticket || store_.contents().in_force() != done.id || !store_.contents().note().empty())) {
    const Status kept = store_.put_in_force(done.id, done.signed_generation);
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
  tables_.give(std::move(setup));
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
    if (!status && installing_->newly_stored) store_.remove(installing_->id);
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

}  // namespace nodal::firmware
