// The table of all requests, and the part of Control that answers them.
#include <fmt/format.h>

#include <array>
#include <utility>

#include "firmware/hosts/control.h"
#include "firmware/hosts/status.h"
#include "firmware/hosts/wire_commands.h"
#include "protocol/base/text.h"
#include "protocol/base/try.h"

namespace nodal::firmware {
namespace {

/// The claim of a host for whom it asks is shown as one, and has no quota of its own.
Requester requester_of(const Client& client, const wire::Request& request) {
  const std::string& claim = request.on_behalf();
  return {Requester::Kind::kHost, client.number(),
          claim.empty() ? client.who() : fmt::format("{} for \"{}\"", client.who(), claim), client.party(),
          client.presence()};
}

/// A claim without control characters or quotation marks cannot be read as more than a claim.
Status check_claim(const std::string& claim) {
  if (claim.size() > kMaxClaimBytes || !is_printable(claim) || claim.find('"') != std::string::npos) {
    return fail(Errc::kBadValue,
                fmt::format("on_behalf may have at most {} bytes, all of them printable and no quotation "
                            "mark; shorten the name",
                            kMaxClaimBytes));
  }
  return {};
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

using What = wire::Request;
constexpr auto kView = Access::kView;
constexpr auto kOperate = Access::kOperate;
constexpr auto kControl = Access::kControl;

/// A request that is answered at once.
constexpr RequestKind answered(What::WhatCase what, std::string_view name, Access access, RequestKind::Answer answer,
                               Turn turn = Turn::kNone) {
  return {what, name, access, nullptr, answer, turn};
}

/// A request that becomes a command of this type.
template <class Type>
constexpr RequestKind becomes(What::WhatCase what, Access access, Turn turn = Turn::kNone) {
  return {what, kCommandKind<Type>.name, access, &kCommandKind<Type>, nullptr, turn};
}

bool is_lossless(const wire::Request& request) { return request.pull().lossless(); }
bool changes_genlock(const wire::Request& request) { return request.genlock().action() != wire::GenlockRequest::SHOW; }
bool changes_exposure(const wire::Request& request) { return request.exposure().ByteSizeLong() > 0; }

}  // namespace

struct Control::Answers {
  static Status status(Control& control, Client&, const wire::Request&, wire::Reply& reply) {
    *reply.mutable_status() = control.status(control.now_);
    return {};
  }

  static Status heads(Control& control, Client&, const wire::Request&, wire::Reply& reply) {
    fill_heads(control.config_, control.operation_.capture(), control.stages_.blender, *reply.mutable_heads());
    return {};
  }

  static Status genlock(Control& control, Client&, const wire::Request&, wire::Reply& reply) {
    fill_genlock(control.config_, control.operation_.capture().genlock, *reply.mutable_genlock());
    return {};
  }

  static Status exposure(Control& control, Client&, const wire::Request&, wire::Reply& reply) {
    fill_exposure(control.operation_.capture().exposure, control.config_.heads.size(), *reply.mutable_exposure());
    return {};
  }

  static Status upload_begin(Control& control, Client& client, const wire::Request& request, wire::Reply& reply) {
    const wire::UploadBegin& begin = request.upload_begin();
    NODAL_TRY_ASSIGN(const auto name, sha256_from_wire(begin.sha256()));
    NODAL_TRY_ASSIGN(const auto offset, control.uploads_.begin(name, begin.length(), client.number()));
    reply.mutable_upload()->set_offset(offset);
    return {};
  }

  static Status pull(Control& control, Client& client, const wire::Request& request, wire::Reply& reply) {
    NODAL_TRY(Admission::may_work(control.clients_, client, control.now_));
    const KeeperReport& keeper = control.operation_.keeper();
    if (!keeper.in_force) {
      return fail(Errc::kNotReady,
                  "there are no raymaps yet: " +
                      (keeper.activity.empty() ? "no calibration is in force; upload one: nodal calibration upload FILE"
                                               : keeper.activity));
    }
    NODAL_TRY_ASSIGN(const auto stream, control.publisher_.start(control.clients_, client, request.pull()));
    reply.mutable_pull()->set_stream(stream);
    return {};
  }

  static Status pull_stop(Control& control, Client& client, const wire::Request& request, wire::Reply& reply) {
    NODAL_TRY(control.publisher_.stop(client, request.pull_stop().stream()));
    reply.mutable_done();
    return {};
  }

  static Status frame_set(Control& control, Client& client, const wire::Request&, wire::Reply& reply) {
    NODAL_TRY_ASSIGN(const auto stream, control.frame_sender_.start(client, control.operation_.head_shapes(),
                                                                    control.operation_.period(), control.now_));
    reply.mutable_pull()->set_stream(stream);
    return {};
  }

  static Status take_read(Control& control, Client& client, const wire::Request& request, wire::Reply& reply) {
    NODAL_TRY_ASSIGN(const auto stream, control.take_sender_.start(client, request.take_read(), control.now_));
    control.operation_.audit().note_take_read(requester_of(client, request), request.take_read().take(), control.now_);
    reply.mutable_pull()->set_stream(stream);
    return {};
  }

  static Status audit_log(Control& control, Client&, const wire::Request& request, wire::Reply& reply) {
    fill_audit(control.operation_.audit().log(), request.audit_log(), control.started_, control.now_,
               control.stages_.utc(), *reply.mutable_audit_log());
    return {};
  }

  static Status hosts(Control& control, Client& client, const wire::Request&, wire::Reply& reply) {
    fill_hosts(control.clients_, client, control.now_, *reply.mutable_hosts());
    return {};
  }

  /// The reply is sent when the audit log has the entry.
  static Status host_end(Control& control, Client& client, const wire::Request& request, wire::Reply&) {
    const std::uint64_t number = request.host_end().number();
    Client* const ended = find_client(control.clients_, number);
    if (!ended || ended->ending()) {
      return fail(Errc::kNotFound, fmt::format("there is no host {}; `nodal hosts` lists them", number));
    }
    if (ended == &client) return fail(Errc::kBadValue, "this host cannot close itself");
    ended->end(Error{Errc::kCancelled, client.name() + " closed this connection"}, control.now_);
    control.say(NewsKind::kHosts, client.name() + " closed " + ended->name());
    Operation& operation = control.operation_;
    const Ticket ticket = operation.note_host_end(requester_of(client, request), ended->who(), control.now_);
    control.replies_.await(client, request.id(), ticket);
    return {};
  }

  /// The reply is sent when the scan has ended.
  static Status devices(Control& control, Client& client, const wire::Request& request, wire::Reply&) {
    if (!control.devices_.available()) {
      return fail(Errc::kUnsupported, "this rig (" + control.software_ + ") has no devices to list");
    }
    control.devices_.ask(client, request.id());
    return {};
  }

  static Status unknown(Control& control, Client&, const wire::Request&, wire::Reply&) {
    return fail(Errc::kUnsupported, "this rig (" + control.software_ + ") does not support that request");
  }

  static constexpr auto kKinds = std::to_array<RequestKind>({
      answered(What::kStatus, "status", kView, &status),
      answered(What::kHeads, "heads", kView, &heads),
      becomes<HeadChange>(What::kHeadSet, kOperate),
      {What::kGenlock, "genlock", kView, &kCommandKind<GenlockStart>, &genlock, Turn::kNone, &changes_genlock,
       kOperate},
      {What::kExposure, "exposure", kView, &kCommandKind<ExposureChange>, &exposure, Turn::kNone, &changes_exposure,
       kOperate},
      answered(What::kUploadBegin, "upload_begin", kControl, &upload_begin),
      becomes<CalibrationRequest::Install>(What::kUploadCommit, kControl, Turn::kCalibrations),
      becomes<CalibrationRequest::List>(What::kCalibrationList, kView),
      becomes<CalibrationRequest::Get>(What::kCalibrationGet, kView),
      becomes<CalibrationRequest::Use>(What::kCalibrationUse, kControl, Turn::kCalibrations),
      becomes<CalibrationRequest::Rollback>(What::kCalibrationRollback, kControl, Turn::kCalibrations),
      becomes<CalibrationRequest::EndTrial>(What::kTrialEnd, kControl, Turn::kCalibrations),
      // A lossless pull prevents shedding, which affects others.
      {What::kPull, "pull", kView, nullptr, &pull, Turn::kNone, &is_lossless},
      answered(What::kPullStop, "pull_stop", kView, &pull_stop),  // a host can only name its own streams
      answered(What::kFrameSet, "frame_set", kView, &frame_set, Turn::kFrameSets),
      answered(What::kAuditLog, "audit_log", kControl, &audit_log),  // names users and processes
      answered(What::kHosts, "hosts", kControl, &hosts),             // names users and processes
      {What::kHostEnd, "host_end", kControl, nullptr, &host_end, Turn::kNone, nullptr, kControl, true},
      answered(What::kDevices, "devices", kControl, &devices),  // opens devices
      becomes<TakeRequest::Start>(What::kTakeStart, kOperate),
      becomes<TakeRequest::Stop>(What::kTakeStop, kOperate),
      becomes<TakeRequest::Mark>(What::kTakeMark, kOperate),
      becomes<TakeRequest::List>(What::kTakeList, kView),
      becomes<TakeRequest::Delete>(What::kTakeDelete, kControl),
      becomes<TakeRequest::Protect>(What::kTakeProtect, kOperate),
      answered(What::kTakeRead, "take_read", kOperate, &take_read, Turn::kTakeReads),
      becomes<TakeRequest::TestDisk>(What::kDiskTest, kControl, Turn::kDiskTest),  // keeps the disk busy
      becomes<TakeRequest::Eject>(What::kDiskEject, kControl),
      answered(What::WHAT_NOT_SET, "unknown request", kView, &unknown),
  });
};

std::span<const RequestKind> request_kinds() { return Control::Answers::kKinds; }

/// False while the request, and all later ones of this host, must wait: the stage that carries it out has the most
/// commands of this host, or of all hosts; the host already has, or waits for, what the request is for; or the audit
/// log takes no such change now.
bool Control::has_room(const Client& client, const wire::Request& request) const {
  const std::uint64_t host = client.number();
  const Turn turn = kind_of(request).turn;
  const bool recorded = is_important(request) || changes_rig(request) || turn == Turn::kTakeReads;
  if (recorded && !operation_.audit().may_change(requester_of(client, request), is_important(request), now_))
    return false;
  switch (turn) {
    case Turn::kFrameSets: return !client.frame_set && !frame_sets_.waits(host);
    case Turn::kTakeReads: return !client.take_file;
    case Turn::kCalibrations:
      if (calibrations_.waits(host)) return false;
      break;
    case Turn::kNone:
    case Turn::kDiskTest: break;
  }
  const CommandKind* const command = command_kind(request);
  if (!command) return true;
  const std::size_t most = command->stage == CommandStage::kCapture ? kCaptureRequests : kSlowRequests;
  return operation_.has_room(command->stage) && operation_.open(host, command->stage) < most;
}

void Control::handle(Client& client, const wire::Request& request, Instant now) {
  if (const Status claim = check_claim(request.on_behalf()); !claim) {
    return replies_.refuse(client, request.id(), claim.error(), now);
  }
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
  wire::Reply reply;
  reply.set_id(request.id());
  const Status done =
      command_kind(request) ? command(client, request, now) : kind_of(request).answer(*this, client, request, reply);
  if (!done) return replies_.refuse(client, request.id(), done.error(), now);
  if (reply.what_case() != wire::Reply::WHAT_NOT_SET) replies_.send(client, reply, now);
}

Status Control::command(Client& client, const wire::Request& request, Instant now) {
  const Requester requester = requester_of(client, request);
  Result<Command> wanted = request.has_upload_commit() ? commit_command(request.upload_commit(), config_, uploads_)
                                                       : command_of(request, config_, client.number());
  if (wanted && request.has_take_delete()) {
    const Status unread = take_sender_.check_unread(clients_, client, request.take_delete().take());
    if (!unread) wanted = fail(unread.error());
  }
  if (!wanted) {
    if (changes_rig(request)) operation_.audit().note_refused(requester, kind_of(request).name, wanted.error(), now);
    return fail(wanted.error());
  }
  const auto* change = std::get_if<CaptureCommand>(&*wanted);
  const bool ends_lease = change && std::holds_alternative<LeaseEnd>(*change);
  NODAL_TRY_ASSIGN(const auto ticket, operation_.ask(requester, std::move(*wanted), now));
  if (request.has_head_set() && request.head_set().temporary()) client.leases = !ends_lease;
  if (kind_of(request).turn == Turn::kCalibrations) calibrations_.begin(ticket);
  replies_.await(client, request.id(), ticket);
  return {};
}

wire::RigStatus Control::status(Instant now) {
  wire::RigStatus status;
  status.set_rig_name(config_.name);
  status.set_state(std::string(health().state));
  status.set_problem(shown(health().problem));
  status.set_uptime_ns(static_cast<std::uint64_t>((now - started_).ns()));
  status.set_clock_ns(static_cast<std::uint64_t>(now.ns()));
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
