#include "firmware/hosts/wire_commands.h"

#include <fmt/format.h>

#include <algorithm>
#include <limits>
#include <utility>

#include "firmware/config/exposure_settings.h"
#include "firmware/hosts/status.h"
#include "protocol/base/limits.h"
#include "protocol/base/try.h"
#include "protocol/upload.h"
#include "protocol/wire_error.h"

namespace nodal::firmware {
namespace {

/// Clamped to the longest Duration, which check() refuses as well.
Duration duration_of(std::uint64_t ns) {
  constexpr std::uint64_t kMax = std::numeric_limits<std::int64_t>::max();
  return Duration::nanoseconds(static_cast<std::int64_t>(std::min(ns, kMax)));
}

/// Clamped to 1000 stops, far above the limit of check().
Stops stops_of(std::uint32_t thousandths) {
  constexpr std::uint32_t kMax = 1'000'000;
  return static_cast<Stops>((std::min(thousandths, kMax) * std::uint64_t{kStop} + 500) / 1000);
}

Result<Command> head_command(const wire::HeadSetRequest& request, const RigConfig& config, std::uint64_t host) {
  if (request.heads_size() > kMaxHeads) {
    return fail(Errc::kBadValue,
                fmt::format("{} heads are named; a rig has at most {}", request.heads_size(), kMaxHeads));
  }
  HeadChange command;
  for (const std::uint32_t head : request.heads()) {
    if (head >= config.heads.size()) return fail(no_such_head(head, config));
    command.heads |= head_bit(head);
  }
  if (request.heads().empty()) command.heads = head_bit(config.heads.size()) - 1;
  SettingsChange& change = command.change;
  if (request.has_exposure_ns()) change.exposure = Exposure::of(duration_of(request.exposure_ns()));
  if (request.has_gain_mdb()) change.gain = Gain::millidecibels(request.gain_mdb());
  if (request.has_red_q12() != request.has_blue_q12()) {
    return fail(Errc::kMissingField, "a white balance needs both red_q12 and blue_q12");
  }
  if (request.has_red_q12()) {
    constexpr std::uint32_t kMax = std::numeric_limits<std::uint16_t>::max();
    // A value above kMax becomes 0, which check() refuses as well.
    const auto q12 = [](std::uint32_t gain) { return static_cast<std::uint16_t>(gain <= kMax ? gain : 0); };
    change.white_balance = WhiteBalance{q12(request.red_q12()), q12(request.blue_q12())};
  }
  if (request.has_gamma()) {
    constexpr std::uint32_t kMax = std::numeric_limits<std::int32_t>::max();
    change.gamma = hal::Gamma::thousandths(static_cast<std::int32_t>(std::min(request.gamma(), kMax)));
  }
  if (request.temporary() && change.empty()) return CaptureCommand(LeaseEnd{host});
  if (request.temporary()) command.lease = host;
  return CaptureCommand(command);
}

Result<Command> exposure_command(const wire::ExposureRequest& request, const RigConfig& config) {
  ExposureChange change;
  if (request.has_program()) {
    change.program = exposure_program_of(request.program());
    if (!change.program) {
      return fail(Errc::kBadValue,
                  "there is no exposure program '" + request.program() + "'; the programs are manual, each and joint");
    }
  }
  if (request.has_anchor()) {
    if (request.anchor() < -1 || request.anchor() >= static_cast<std::int32_t>(config.heads.size())) {
      return fail(Errc::kBadValue, fmt::format("the anchor is head {}, which does not exist", request.anchor()));
    }
    change.anchor.emplace();
    if (request.anchor() >= 0) *change.anchor = static_cast<HeadIndex>(request.anchor());
  }
  if (request.has_target_below()) change.target = -stops_of(request.target_below());
  if (request.has_difference()) change.difference = stops_of(request.difference());
  if (request.has_ramp()) change.ramp = stops_of(request.ramp());
  if (request.has_longest_ns()) change.longest = Exposure::of(duration_of(request.longest_ns()));
  if (request.has_highest_gain_mdb()) change.highest = Gain::millidecibels(request.highest_gain_mdb());
  if (request.has_locked()) change.locked = request.locked();
  return CaptureCommand(change);
}

Result<Command> genlock_command(const wire::GenlockRequest& request) {
  if (request.action() == wire::GenlockRequest::STOP) return CaptureCommand(GenlockStop{});
  if (request.action() != wire::GenlockRequest::START) {
    return fail(Errc::kUnsupported, "this rig does not support that genlock action; update nodald");
  }
  GenlockStart start;
  if (request.rate_numerator() != 0 || request.rate_denominator() != 0) {
    start.rate = FrameRate::make(request.rate_numerator(), request.rate_denominator());
    if (!start.rate) {
      return fail(Errc::kBadValue,
                  fmt::format("a rate of {}/{} is not allowed; allowed is {}", request.rate_numerator(),
                              request.rate_denominator(), kFrameRatesAllowed));
    }
  }
  if (request.pulse_width_ns() != 0) start.pulse_width = duration_of(request.pulse_width_ns());
  return CaptureCommand(start);
}

Command take_start_command(const wire::TakeStart& request) {
  TakeRequest::Start start;
  start.still = request.still();
  return TakeCommand(std::move(start));
}

Result<Command> take_delete_command(const wire::TakeDelete& request) {
  TakeRequest::Delete command{request.take()};
  if (!request.manifest_sha256().empty()) {
    NODAL_TRY_ASSIGN(const auto manifest, sha256_from_wire(request.manifest_sha256()));
    command.manifest = manifest;
  }
  return TakeCommand(command);
}

Command disk_test_command(const wire::DiskTest& request) {
  TakeRequest::TestDisk test;
  if (request.length_ns() != 0) test.length = duration_of(request.length_ns());
  return TakeCommand(std::move(test));
}

}  // namespace

Result<Command> command_of(const wire::Request& request, const RigConfig& config, std::uint64_t host) {
  switch (request.what_case()) {
    case wire::Request::kHeadSet: return head_command(request.head_set(), config, host);
    case wire::Request::kExposure: return exposure_command(request.exposure(), config);
    case wire::Request::kGenlock: return genlock_command(request.genlock());
    case wire::Request::kCalibrationList: return CalibrationCommand(CalibrationRequest::List{});
    case wire::Request::kCalibrationGet:
      return CalibrationCommand(CalibrationRequest::Get{request.calibration_get().id()});
    case wire::Request::kCalibrationUse:
      return CalibrationCommand(
          CalibrationRequest::Use{request.calibration_use().id(), request.calibration_use().allow_older()});
    case wire::Request::kCalibrationRollback: return CalibrationCommand(CalibrationRequest::Rollback{});
    case wire::Request::kTrialEnd:
      return CalibrationCommand(CalibrationRequest::EndTrial{request.trial_end().id(), request.trial_end().keep()});
    case wire::Request::kTakeStart: return take_start_command(request.take_start());
    case wire::Request::kTakeStop: return TakeCommand(TakeRequest::Stop{});
    case wire::Request::kTakeMark: return TakeCommand(TakeRequest::Mark{request.take_mark().text()});
    case wire::Request::kTakeList: return TakeCommand(TakeRequest::List{});
    case wire::Request::kTakeDelete: return take_delete_command(request.take_delete());
    case wire::Request::kTakeProtect:
      return TakeCommand(TakeRequest::Protect{request.take_protect().take(), request.take_protect().on()});
    case wire::Request::kDiskTest: return disk_test_command(request.disk_test());
    case wire::Request::kDiskEject: return TakeCommand(TakeRequest::Eject{});
    default: return fail(Errc::kUnsupported, "this rig does not support that request; update nodald");
  }
}

Result<CalibrationRequest::Install> install_of(const wire::UploadCommit& commit) {
  if (commit.signature().size() > kMaxSignatureBytes) {
    return fail(Errc::kTooLarge, fmt::format("a signature has at most {} bytes", kMaxSignatureBytes));
  }
  CalibrationRequest::Install install{"", std::nullopt, commit.signature(), commit.allow_older()};
  if (commit.has_trial_ns()) install.trial = duration_of(commit.trial_ns());
  return install;
}

wire::Reply reply_of(const Answer& answer, const RigConfig& config) {
  wire::Reply reply;
  if (!answer.outcome) {
    *reply.mutable_error() = to_wire(answer.outcome.error());
    return reply;
  }
  if (!answer.not_stored.empty()) reply.set_not_stored(answer.not_stored);
  if (!answer.not_recorded.empty()) reply.set_not_recorded(answer.not_recorded);
  const Outcome& outcome = *answer.outcome;
  if (const auto* genlock = std::get_if<GenlockReport>(&outcome)) {
    fill_genlock(config, *genlock, *reply.mutable_genlock());
  } else if (const auto* exposure = std::get_if<ExposureControl::Report>(&outcome)) {
    fill_exposure(*exposure, config.heads.size(), *reply.mutable_exposure());
  } else if (const auto* listed = std::get_if<CalibrationAnswer::Listed>(&outcome)) {
    fill_calibrations(*listed, *reply.mutable_calibrations());
  } else if (const auto* document = std::get_if<CalibrationAnswer::Document>(&outcome)) {
    reply.mutable_calibration()->set_id(sha256_to_wire(document->id));
    reply.mutable_calibration()->set_json(document->json);
  } else if (const auto* take = std::get_if<TakeAnswer::Done>(&outcome)) {
    reply.mutable_take()->set_take(take->take);
  } else if (const auto* takes = std::get_if<TakeAnswer::Listed>(&outcome)) {
    fill_takes(*takes, *reply.mutable_takes());
  } else if (const auto* tested = std::get_if<TakeAnswer::DiskTested>(&outcome)) {
    fill_disk_test(*tested, *reply.mutable_disk_test());
  } else {
    const auto at = std::get<CommandDone>(outcome).at;
    if (at) reply.mutable_done()->set_at_ns(static_cast<std::uint64_t>(at->ns()));
    else reply.mutable_done();
  }
  return reply;
}

}  // namespace nodal::firmware
