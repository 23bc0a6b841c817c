// The part of Control that answers requests.
#include <fmt/format.h>

#include <utility>

#include "firmware/hosts/control.h"
#include "firmware/hosts/status.h"
#include "firmware/hosts/wire_commands.h"
#include "protocol/base/try.h"

namespace nodal::firmware {
namespace {

Requester requester_of(const Client& client) {
  return {Requester::Kind::kHost, client.number(), client.who(), client.party(), client.presence()};
}

Result<Command> commit_command(const wire::UploadCommit& commit, const RigConfig& config, UploadReceiver& uploads) {
  NODAL_TRY_ASSIGN(const auto name, sha256_from_wire(commit.sha256()));
  NODAL_TRY_ASSIGN(auto install, install_of(commit));
  // Checked before the document is taken, so that a host can correct and repeat a refused commit.
  NODAL_TRY(check(CalibrationCommand(install), config));
  NODAL_TRY_ASSIGN(auto document, uploads.take(name));
  install.json.assign(document.begin(), document.end());
  return CalibrationCommand(std::move(install));
}

}  // namespace

/// False while the request, and all later ones of this host, must wait: the stage that carries it out has the most
/// commands of this host, or of all hosts; the host already has, or waits for, what the request is for; or the audit
/// log takes no such change now.
bool Control::has_room(const Client& client, const wire::Request& request) const {
  const std::uint64_t host = client.number();
  const RequestKind& kind = kind_of(request);
  const bool recorded = kind.important || changes_rig(request) || kind.turn == Turn::kTakeReads;
  if (recorded && !operation_.audit().may_change(requester_of(client), kind.important, now_)) return false;
  switch (kind.turn) {
    case Turn::kFrameSets: return !client.frame_set && !frame_sets_.waits(host);
    case Turn::kTakeReads: return !client.take_file;
    case Turn::kCalibrations:
      if (calibrations_.waits(host)) return false;
      break;
    case Turn::kNone:
    case Turn::kDiskTest: break;
  }
  if (!kind.slow_stage && !changes_rig(request)) return true;
  const CommandStage stage = kind.slow_stage.value_or(CommandStage::kCapture);
  const std::size_t most = kind.slow_stage ? kSlowRequests : kCaptureRequests;
  return operation_.has_room(stage) && operation_.open(host, stage) < most;
}

void Control::handle(Client& client, const wire::Request& request, Instant now) {
  if (Status permitted = check_access(client.access(), request); !permitted) {
    say(NewsKind::kHosts, client.who() + ": " + permitted.error().text());
    return replies_.refuse(client, request.id(), permitted.error(), now);
  }
  const Turn turn = kind_of(request).turn;  // TakeSender and TakeKeeper share their turns themselves
  if (turn == Turn::kFrameSets) frame_sets_.add(client, request);
  else if (turn == Turn::kCalibrations) calibrations_.add(client, request);
  else carry_out(client, request, now);
}

/// Carries out the requests whose turn has come.
bool Control::serve_turns(Instant now) {
  const auto serve_next = [&](Turns& turns) {
    const auto next = turns.next(clients_);
    if (next && next->client && !next->client->ending()) carry_out(*next->client, next->request, now);
    return next.has_value();
  };
  bool busy = false;
  while (frame_sender_.has_room() && serve_next(frame_sets_)) busy = true;
  while (!calibrations_.working() && serve_next(calibrations_)) busy = true;
  return busy;
}

void Control::carry_out(Client& client, const wire::Request& request, Instant now) {
  const bool later = changes_rig(request) || kind_of(request).slow_stage;  // another stage carries it out
  const Status done = later ? command(client, request, now) : answer(client, request, now);
  if (!done) replies_.refuse(client, request.id(), done.error(), now);
}

Status Control::answer(Client& client, const wire::Request& request, Instant now) {
  wire::Reply answer;
  answer.set_id(request.id());
  switch (request.what_case()) {
    case wire::Request::kStatus: *answer.mutable_status() = status(now); break;
    case wire::Request::kHeads:
      fill_heads(config_, operation_.capture(), stages_.blender, *answer.mutable_heads());
      break;
    case wire::Request::kGenlock: fill_genlock(config_, operation_.capture().genlock, *answer.mutable_genlock()); break;
    case wire::Request::kExposure:
      fill_exposure(operation_.capture().exposure, config_.heads.size(), *answer.mutable_exposure());
      break;
    case wire::Request::kUploadBegin: {
      NODAL_TRY_ASSIGN(const auto name, sha256_from_wire(request.upload_begin().sha256()));
      NODAL_TRY_ASSIGN(const auto offset, uploads_.begin(name, request.upload_begin().length(), client.number()));
      answer.mutable_upload()->set_offset(offset);
      break;
    }
    case wire::Request::kPull:
    case wire::Request::kFrameSet:
    case wire::Request::kTakeRead: {
      NODAL_TRY_ASSIGN(const auto stream, start_work(client, request, now));
      answer.mutable_pull()->set_stream(stream);
      break;
    }
    case wire::Request::kPullStop:
      NODAL_TRY(publisher_.stop(client, request.pull_stop().stream()));
      answer.mutable_done();
      break;
    case wire::Request::kAuditLog:
      fill_audit(operation_.audit().log(), request.audit_log(), started_, now, stages_.utc(),
                 *answer.mutable_audit_log());
      break;
    case wire::Request::kHosts: fill_hosts(clients_, client, now, *answer.mutable_hosts()); break;
    case wire::Request::kHostEnd: return end_host(client, request, now);
    case wire::Request::kDevices:
      if (!devices_.available()) return fail(Errc::kUnsupported, "this rig (" + software_ + ") has no devices to list");
      devices_.ask(client, request.id());
      return {};
    default: return fail(Errc::kUnsupported, "this rig (" + software_ + ") does not support that request");
  }
  replies_.send(client, answer, now);
  return {};
}

Status Control::command(Client& client, const wire::Request& request, Instant now) {
  const Requester requester = requester_of(client);
  Result<Command> wanted = request.has_upload_commit() ? commit_command(request.upload_commit(), config_, uploads_)
                                                       : command_of(request, config_, client.number());
  if (!wanted) {
    if (changes_rig(request)) operation_.audit().note_refused(requester, kind_of(request).name, wanted.error(), now);
    return fail(wanted.error());
  }
  if (request.has_take_delete()) {
    const Status unread = take_sender_.check_unread(clients_, client, request.take_delete().take());
    if (!unread) operation_.audit().note_refused(requester, kind_of(request).name, unread.error(), now);
    if (!unread) return unread;
  }
  const auto* change = std::get_if<CaptureCommand>(&*wanted);
  const bool ends_lease = change && std::holds_alternative<LeaseEnd>(*change);
  NODAL_TRY_ASSIGN(const auto ticket, operation_.ask(requester, std::move(*wanted), now));
  if (request.has_head_set() && request.head_set().temporary()) client.leases = !ends_lease;
  if (kind_of(request).turn == Turn::kCalibrations) calibrations_.begin(ticket);
  replies_.await(client, request.id(), ticket);
  return {};
}

Result<StreamId> Control::start_work(Client& client, const wire::Request& request, Instant now) {
  // These share what they need in turns; pulls do not.
  if (request.has_frame_set()) return frame_sender_.start(client, operation_.head_shapes(), operation_.period(), now);
  if (request.has_take_read()) {
    auto begun = take_sender_.start(client, request.take_read(), now);
    if (begun) operation_.audit().note_take_read(requester_of(client), request.take_read().take(), now);
    return begun;
  }
  NODAL_TRY(Admission::may_work(clients_, client, now));
  const KeeperReport& keeper = operation_.keeper();
  if (!keeper.in_force) {
    return fail(Errc::kNotReady,
                "there are no raymaps yet: " +
                    (keeper.activity.empty() ? "no calibration is in force; upload one: nodal calibration upload FILE"
                                             : keeper.activity));
  }
  return publisher_.start(clients_, client, request.pull());
}

/// The answer is sent when the audit log has the entry.
Status Control::end_host(Client& client, const wire::Request& request, Instant now) {
  const std::uint64_t number = request.host_end().number();
  Client* const ended = find_client(clients_, number);
  if (!ended || ended->ending()) {
    return fail(Errc::kNotFound, fmt::format("there is no host {}; `nodal hosts` lists them", number));
  }
  if (ended == &client) return fail(Errc::kBadValue, "this host cannot close itself");
  ended->end(Error{Errc::kCancelled, client.name() + " closed this connection"}, now);
  say(NewsKind::kHosts, client.name() + " closed " + ended->name());
  replies_.await(client, request.id(), operation_.note_host_end(requester_of(client), ended->who(), now));
  return {};
}

wire::RigStatus Control::status(Instant now) {
  wire::RigStatus status;
  status.set_rig_name(config_.name);
  status.set_state(std::string(health().state));
  status.set_problem(shown(health().problem));
  status.set_uptime_ns(static_cast<std::uint64_t>((now - started_).ns()));
  fill_capture(config_, operation_.capture(), status);

  const Blender::Counts& counts = stages_.blender.counts();
  const auto read = [](const std::atomic<std::uint64_t>& count) { return count.load(std::memory_order_relaxed); };
  status.set_raymaps(read(counts.blended));
  add_count(*status.mutable_set_losses(), "overload", sets_missed_by_blend());
  add_count(*status.mutable_set_losses(), "no-calibration", read(counts.without_calibration));
  add_count(*status.mutable_set_losses(), "no-buffer", read(counts.without_buffer));
  add_count(*status.mutable_set_losses(), "shed", read(counts.shed));
  if (config_.raymap.seams == SeamPlacement::kPlaced) {
    wire::Seams& seams = *status.mutable_seams();
    const MovingSeams::Counts& placed = stages_.blender.seams().counts();
    seams.set_placed(read(placed.moved));
    seams.set_late(read(placed.late));
    seams.set_refused(read(placed.refused));
  }
  status.set_publish_shed(publisher_.shed());
  status.set_published(publisher_.published());
  status.set_rate_wanted_millihertz(operation_.watch().rate_wanted_millihertz(operation_.capture()));
  status.set_raymaps_a_set(static_cast<std::uint32_t>(config_.raymap.raymaps_a_set()));
  status.set_rate_millihertz(operation_.watch().rate_millihertz());
  status.set_blend_ns(static_cast<std::uint64_t>(stages_.blender.times().median().ns()));
  status.set_encode_ns(static_cast<std::uint64_t>(stages_.encoder.times().median().ns()));
  status.set_encode_failures(stages_.encoder.failed());

  const KeeperReport& keeper = operation_.keeper();
  if (keeper.in_force) {
    status.set_calibration_id(sha256_to_wire(*keeper.in_force));
    status.set_calibration_name(shown(keeper.name));
  }
  if (keeper.trial) fill_trial(*keeper.trial, now, *status.mutable_trial());
  status.set_activity(shown(keeper.activity));
  status.set_raymap_width(static_cast<std::uint32_t>(config_.raymap.width));
  status.set_raymap_height(static_cast<std::uint32_t>(config_.raymap.height));
  status.set_resident_bytes(resident_bytes_.load(std::memory_order_relaxed));
  if (const TakeReport* takes = operation_.takes()) fill_recording(*takes, now, *status.mutable_recording());
  for (const Operation::Mark& mark : operation_.marks()) {
    wire::Mark& added = *status.add_marks();
    added.set_set(mark.set);
    added.set_at_ns(static_cast<std::uint64_t>((mark.at - started_).ns()));
  }
  for (const auto& client : clients_) {
    add_count(*status.mutable_publish_drops(), client->name(), Publisher::dropped(*client));
  }
  return status;
}

}  // namespace nodal::firmware
