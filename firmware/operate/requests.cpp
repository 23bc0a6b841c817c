// The half of Control that answers requests.
#include "firmware/hosts/status.h"
#include "firmware/operate/control.h"
#include "protocol/base/limits.h"

namespace nodal::firmware {
namespace {

decltype(KeeperRequest::what) keeper_question(const wire::Request& request) {
  switch (request.what_case()) {
    case wire::Request::kCalibrationGet: return KeeperRequest::Get{request.calibration_get().id()};
    case wire::Request::kCalibrationUse: return KeeperRequest::Use{request.calibration_use().id()};
    case wire::Request::kCalibrationRollback: return KeeperRequest::Rollback{};
    case wire::Request::kTrialEnd: return KeeperRequest::EndTrial{request.trial_end().id(), request.trial_end().keep()};
    default: return KeeperRequest::List{};
  }
}

Status gain_allowed(std::int32_t mdb) {
  if (mdb >= -kMostGainMdb && mdb <= kMostGainMdb) return {};
  return fail(Errc::kBadValue, "a gain of " + std::to_string(mdb) + " mdB is not allowed; allowed is " +
                                   std::to_string(-kMostGainMdb) + " to " + std::to_string(kMostGainMdb) + " mdB");
}

}  // namespace

/// A request that would be one too many for the stage that carries it out waits, and what this host asks after it.
bool Control::has_room(const Client& client, const wire::Request& request) {
  if (needs_keeper(request)) return client.with_keeper < kKeeperRequests;
  return !changes_rig(request) || client.with_capture < kCaptureRequests;
}

void Control::handle(Client& client, const wire::Request& request, Instant now) {
  wire::Reply answer;
  answer.set_id(request.id());
  Status done;
  bool later = changes_rig(request);  // another stage answers
  if (Status permitted = check_access(client.access(), request); !permitted) {
    news_.say(NewsKind::kHosts, client.who() + ": " + permitted.error().text());
    return refuse(client, request.id(), permitted.error(), now);
  }
  switch (request.what_case()) {
    case wire::Request::kStatus: *answer.mutable_status() = status(now); break;
    case wire::Request::kHeads: fill_heads(config_, *capture_, *answer.mutable_heads()); break;
    case wire::Request::kHeadSet: done = set(client.number(), request); break;
    case wire::Request::kGenlock:
      if (later) done = set(client.number(), request);
      else fill_genlock(config_, capture_->genlock, *answer.mutable_genlock());
      break;
    case wire::Request::kExposure:
      if (later) done = set(client.number(), request);
      else fill_exposure(capture_->exposure, config_.heads.size(), *answer.mutable_exposure());
      break;
    case wire::Request::kUploadBegin: {
      const auto name = sha256_from_wire(request.upload_begin().sha256());
      const auto offset =
          name ? uploads_.begin(*name, request.upload_begin().length(), client.number()) : fail(name.error());
      if (offset) answer.mutable_upload()->set_offset(*offset);
      else done = fail(offset.error());
      break;
    }
    case wire::Request::kUploadCommit: done = commit(client, request); break;
    case wire::Request::kCalibrationList:
    case wire::Request::kCalibrationGet:
    case wire::Request::kCalibrationUse:
    case wire::Request::kCalibrationRollback:
    case wire::Request::kTrialEnd:
      later = true;
      done = ask_keeper(client, request, keeper_question(request));
      break;
    case wire::Request::kPull:
    case wire::Request::kFrameSet: {
      const auto stream = start_work(client, request, now);
      if (stream) answer.mutable_pull()->set_stream(*stream);
      else done = fail(stream.error());
      break;
    }
    case wire::Request::kPullStop:
      done = publisher_.stop(client, request.pull_stop().stream());
      if (done) answer.mutable_done();
      break;
    case wire::Request::kAuditLog:
      answer.mutable_audit_log()->set_now_ns(static_cast<std::uint64_t>((now - started_).ns()));
      fill_audit(audit_, started_, *answer.mutable_audit_log());
      break;
    case wire::Request::kHosts: fill_hosts(clients_, client, now, *answer.mutable_hosts()); break;
    case wire::Request::kHostEnd:
      done = end_host(client, request.host_end().number(), now);
      if (done) answer.mutable_done();
      break;
    case wire::Request::WHAT_NOT_SET:
      done = fail(Errc::kUnsupported, "this rig (" + software_ + ") does not know that request");
      break;
  }
  if (!done) {
    if (changes_rig(request)) audit(open_request(client.number(), request), keeper_->in_force, done, now);
    return refuse(client, request.id(), done.error(), now);
  }
  if (!later) reply(client, answer, now);
}

/// Notes who asks and what is so now, for the audit log.
Control::Open Control::open_request(std::uint64_t client, const wire::Request& request) {
  Open open{client, request, "settings of the last start", ""};
  if (const Client* const host = find(client)) open.who = host->who();
  if (client == kPanel) open.who = "button";
  if (changes_rig(request)) open.before = values_before(request, config_, *capture_, *keeper_);
  return open;
}

void Control::audit(const Open& open, const std::optional<Sha256>& in_force, const Status& done, Instant now) {
  if (!changes_rig(open.request)) return;
  std::optional<Error> error;
  if (!done) error = done.error();
  news_.say(NewsKind::kChanges, audit_.record({0, now, open.who, std::string(request_name(open.request)), open.before,
                                               values_after(open.request, in_force), std::move(error)}));
}

Result<StreamId> Control::start_work(Client& client, const wire::Request& request, Instant now) {
  if (const Status may = Admission::may_work(clients_, client, now); !may) return fail(may.error());
  if (request.has_frame_set()) return frame_sender_.start(client, head_shapes(), now);
  if (!keeper_->in_force) {
    return fail(Errc::kNotReady,
                "there are no raymaps yet: " +
                    (keeper_->activity.empty() ? "no calibration is in force; upload one: nodal calibration upload FILE"
                                               : keeper_->activity));
  }
  return publisher_.start(clients_, client, request.pull());
}

Status Control::end_host(const Client& client, std::uint64_t number, Instant now) {
  Client* const ended = find(number);
  if (!ended || ended->ending()) {
    return fail(Errc::kNotFound, "there is no host " + std::to_string(number) + "; `nodal hosts` lists them");
  }
  if (ended == &client) return fail(Errc::kBadValue, "this is the host that asks");
  ended->end(Error{Errc::kCancelled, client.name() + " ended this conversation"}, now);
  news_.say(NewsKind::kHosts, client.name() + " ended " + ended->name());
  return {};
}

/// Asks capture for a setting, for a client or one of those that need no answer.
Status Control::set(std::uint64_t client, const wire::Request& request) {
  Result<CaptureCommand> command = request.has_genlock()    ? genlock_command(request.genlock())
                                   : request.has_exposure() ? exposure_command(request.exposure())
                                                            : head_command(request.head_set());
  if (!command) return fail(command.error());
  command->ticket = next_ticket_++;
  const std::uint64_t ticket = command->ticket;
  if (!stages_.capture.commands().push(std::move(*command))) {
    return fail(Errc::kBusy, "the rig has more requests than it can take; try again");
  }
  open_[ticket] = open_request(client, request);
  if (Client* const waits = find(client)) {
    ++waits->requests_open;
    ++waits->with_capture;
  }
  return {};
}

Status Control::ask_keeper(Client& client, const wire::Request& request, decltype(KeeperRequest::what) what) {
  const std::uint64_t ticket = next_ticket_++;
  if (!stages_.keeper.requests().push(KeeperRequest{ticket, std::move(what), head_shapes()})) {
    return fail(Errc::kBusy, "the rig has more requests about calibrations than it can take; try again");
  }
  open_[ticket] = open_request(client.number(), request);
  ++client.requests_open;
  ++client.with_keeper;
  return {};
}

Result<CaptureCommand> Control::head_command(const wire::HeadSetRequest& wish) const {
  if (wish.heads_size() > kMaxHeads) {
    return fail(Errc::kBadValue,
                std::to_string(wish.heads_size()) + " heads are named; a rig has at most " + std::to_string(kMaxHeads));
  }
  HeadChange change;
  for (const std::uint32_t head : wish.heads()) {
    if (head >= config_.heads.size()) {
      return fail(Errc::kBadValue, "there is no head " + std::to_string(head) + "; the rig has 0 to " +
                                       std::to_string(config_.heads.size() - 1));
    }
    change.heads |= head_bit(head);
  }
  if (wish.heads().empty()) change.heads = head_bit(config_.heads.size()) - 1;
  constexpr std::uint64_t kLongest = 3'600'000'000'000;  // an hour; a head's own limit is far below
  if (wish.has_exposure_ns()) {
    if (wish.exposure_ns() == 0 || wish.exposure_ns() > kLongest) {
      return fail(Errc::kBadValue, "an exposure of " + std::to_string(wish.exposure_ns()) +
                                       " ns is not allowed; allowed is 1 ns to 1 hour, and less by most heads");
    }
    change.change.exposure = Exposure::of(Duration::nanoseconds(static_cast<std::int64_t>(wish.exposure_ns())));
  }
  if (wish.has_gain_mdb()) {
    if (Status allowed = gain_allowed(wish.gain_mdb()); !allowed) return fail(allowed.error());
    change.change.gain = Gain::millidecibels(wish.gain_mdb());
  }
  if (wish.has_red_q12() != wish.has_blue_q12()) {
    return fail(Errc::kMissingField, "a white balance needs both red_q12 and blue_q12");
  }
  if (wish.has_red_q12()) {
    if (wish.red_q12() < 256 || wish.red_q12() > 65535 || wish.blue_q12() < 256 || wish.blue_q12() > 65535) {
      return fail(Errc::kBadValue, "white balance gains are 256 to 65535, in 1/4096");
    }
    change.change.white_balance =
        WhiteBalance{static_cast<std::uint16_t>(wish.red_q12()), static_cast<std::uint16_t>(wish.blue_q12())};
  }
  if (wish.has_gamma()) {
    if (wish.gamma() != 0 && (wish.gamma() < 100 || wish.gamma() > 8000)) {
      return fail(Errc::kBadValue, "a gamma is 100 to 8000, in thousandths, or 0 for the head's own curve");
    }
    change.change.gamma = hal::Gamma::thousandths(static_cast<std::int32_t>(wish.gamma()));
  }
  return CaptureCommand{0, change};
}

Result<CaptureCommand> Control::exposure_command(const wire::ExposureRequest& wish) const {
  ExposureChange change;
  if (wish.has_program()) {
    const auto program = exposure_program_of(wish.program());
    if (!program) {
      return fail(Errc::kBadValue, "there is no exposure program '" + wish.program() + "'; manual, each and joint are");
    }
    change.program = *program;
  }
  if (wish.has_anchor()) {
    if (wish.anchor() < -1 || wish.anchor() >= static_cast<std::int32_t>(config_.heads.size())) {
      return fail(Errc::kBadValue, "there is no head " + std::to_string(wish.anchor()) + " to anchor on");
    }
    change.anchor.emplace();
    if (wish.anchor() >= 0) *change.anchor = static_cast<HeadIndex>(wish.anchor());
  }
  // Only of what is within(): a larger number times 1024 exceeds 32 bits.
  const auto stops = [](std::uint32_t thousandths) { return static_cast<Stops>((thousandths * kStop + 500) / 1000); };
  const auto within = [](std::uint32_t value, std::uint32_t low, const char* what) -> Status {
    if (value >= low && value <= 8000) return {};
    return fail(Errc::kBadValue, std::string(what) + " is " + std::to_string(low) +
                                     " to 8000 thousandths of a stop, not " + std::to_string(value));
  };
  Status good;
  if (wish.has_target_below()) {
    good = within(wish.target_below(), 500, "the target");
    if (good) change.target = -stops(wish.target_below());
  }
  if (good && wish.has_difference()) {
    good = within(wish.difference(), 0, "the difference");
    if (good) change.difference = stops(wish.difference());
  }
  if (good && wish.has_ramp()) {
    good = within(wish.ramp(), 1, "the ramp");
    if (good) change.ramp = stops(wish.ramp());
  }
  if (good && wish.has_longest_ns()) {
    if (wish.longest_ns() < 1000 || wish.longest_ns() > 10'000'000'000) {
      return fail(Errc::kBadValue, "the longest shutter is 1 us to 10 s");
    }
    change.longest = Exposure::of(Duration::nanoseconds(static_cast<std::int64_t>(wish.longest_ns())));
  }
  if (good && wish.has_highest_gain_mdb()) {
    good = gain_allowed(wish.highest_gain_mdb());
    change.highest = Gain::millidecibels(wish.highest_gain_mdb());
  }
  if (wish.has_locked()) change.locked = wish.locked();
  if (!good) return fail(good.error());
  return CaptureCommand{0, change};
}

Result<CaptureCommand> Control::genlock_command(const wire::GenlockRequest& wish) const {
  if (wish.action() == wire::GenlockRequest::STOP) return CaptureCommand{0, GenlockStop{}};
  if (wish.action() != wire::GenlockRequest::START) {
    return fail(Errc::kUnsupported, "this rig (" + software_ + ") does not know that genlock action");
  }
  GenlockStart start;
  if (wish.rate_numerator() != 0 || wish.rate_denominator() != 0) {
    start.rate = FrameRate::make(wish.rate_numerator(), wish.rate_denominator());
    if (!start.rate) {
      return fail(Errc::kBadValue, "a rate of " + std::to_string(wish.rate_numerator()) + "/" +
                                       std::to_string(wish.rate_denominator()) + " is not allowed; allowed is " +
                                       std::string(kFrameRatesAllowed));
    }
  }
  if (wish.pulse_width_ns() != 0) {
    const std::int64_t period = start.rate.value_or(config_.rate).period().ns();
    if (wish.pulse_width_ns() >= static_cast<std::uint64_t>(period)) {
      return fail(Errc::kBadValue, "a trigger pulse must be shorter than a frame, " + std::to_string(period) + " ns");
    }
    start.pulse_width = Duration::nanoseconds(static_cast<std::int64_t>(wish.pulse_width_ns()));
  }
  return CaptureCommand{0, start};
}

Status Control::commit(Client& client, const wire::Request& request) {
  const wire::UploadCommit& wish = request.upload_commit();
  const auto name = sha256_from_wire(wish.sha256());
  if (!name) return fail(name.error());
  std::optional<Duration> trial;
  if (wish.has_trial_ns()) {
    if (wish.trial_ns() < 1'000'000'000 || wish.trial_ns() > 3'600'000'000'000) {
      return fail(Errc::kBadValue, "a trial lasts 1 s to 1 hour");
    }
    trial = Duration::nanoseconds(static_cast<std::int64_t>(wish.trial_ns()));
  }
  if (wish.signature().size() > kMaxSignatureBytes) {
    return fail(Errc::kTooLarge, "a signature has at most " + std::to_string(kMaxSignatureBytes) + " bytes");
  }
  auto document = uploads_.take(*name);
  if (!document) return fail(document.error());
  return ask_keeper(client, request,
                    KeeperRequest::Install{std::string(document->begin(), document->end()), trial, wish.signature()});
}

HeadShapes Control::head_shapes() const {
  HeadShapes shapes;
  for (const HeadReport& head : capture_->heads) {
    shapes.emplace_back();
    if (head.format) shapes.back() = HeadShape{head.format->pixels, head.format->width, head.format->height};
  }
  return shapes;
}

wire::RigStatus Control::status(Instant now) {
  wire::RigStatus status;
  status.set_rig_name(config_.name);
  status.set_state(std::string(health().state));
  status.set_problem(shown(health().problem));
  status.set_uptime_ns(static_cast<std::uint64_t>((now - started_).ns()));
  fill_capture(config_, *capture_, status);

  const Blender::Counts& counts = stages_.blender.counts();
  const auto read = [](const std::atomic<std::uint64_t>& count) { return count.load(std::memory_order_relaxed); };
  status.set_raymaps(read(counts.blended));
  add_count(*status.mutable_set_losses(), "overload", sets_missed_by_blend());
  add_count(*status.mutable_set_losses(), "no-calibration", read(counts.without_calibration));
  add_count(*status.mutable_set_losses(), "no-buffer", read(counts.without_buffer));
  add_count(*status.mutable_set_losses(), "shed", read(counts.shed));
  status.set_publish_shed(publisher_.shed());
  status.set_published(publisher_.published());
  status.set_rate_wanted_millihertz(rate_wanted_millihertz());
  status.set_raymaps_a_set(static_cast<std::uint32_t>(config_.raymap.raymaps_a_set()));
  status.set_rate_millihertz(rate_.millihertz());
  status.set_blend_ns(static_cast<std::uint64_t>(stages_.blender.times().median().ns()));
  status.set_encode_ns(static_cast<std::uint64_t>(stages_.encoder.times().median().ns()));
  status.set_encode_failures(stages_.encoder.failed());

  if (keeper_->in_force) {
    status.set_calibration_id(sha256_to_wire(*keeper_->in_force));
    status.set_calibration_name(shown(keeper_->name));
  }
  if (keeper_->trial) fill_trial(*keeper_->trial, now, *status.mutable_trial());
  status.set_activity(shown(keeper_->activity));
  status.set_raymap_width(static_cast<std::uint32_t>(config_.raymap.width));
  status.set_raymap_height(static_cast<std::uint32_t>(config_.raymap.height));
  status.set_resident_bytes(resident_bytes_.load(std::memory_order_relaxed));
  for (const Mark& mark : marks_) {
    wire::Mark& told = *status.add_marks();
    told.set_set(mark.set);
    told.set_at_ns(static_cast<std::uint64_t>((mark.at - started_).ns()));
  }
  for (const auto& client : clients_) {
    add_count(*status.mutable_publish_drops(), client->name(), Publisher::dropped(*client));
  }
  return status;
}

}  // namespace nodal::firmware
