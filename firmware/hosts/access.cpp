#include "firmware/hosts/access.h"

#include <algorithm>
#include <array>

namespace nodal::firmware {
namespace {

using What = wire::Request;
constexpr auto kView = Access::kView;
constexpr auto kControl = Access::kControl;
constexpr auto kNever = Holds::kNever;
constexpr auto kAlways = Holds::kAlways;
constexpr auto kByValues = Holds::kByValues;
constexpr auto kKeeper = CommandStage::kKeeper;
constexpr auto kTakes = CommandStage::kTakes;
constexpr bool kImportant = true;

constexpr auto kKinds = std::to_array<RequestKind>({
    {What::kStatus, "status", kView},
    {What::kHeads, "heads", kView},
    {What::kHeadSet, "head_set", kControl, kNever, kAlways},
    {What::kGenlock, "genlock", kView, kByValues, kByValues},
    {What::kExposure, "exposure", kView, kByValues, kByValues},
    {What::kUploadBegin, "upload_begin", kControl},
    {What::kUploadCommit, "upload_commit", kControl, kNever, kAlways, kKeeper, Turn::kCalibrations, kImportant},
    {What::kCalibrationList, "calibration_list", kView, kNever, kNever, kKeeper},
    {What::kCalibrationGet, "calibration_get", kView, kNever, kNever, kKeeper},
    {What::kCalibrationUse, "calibration_use", kControl, kNever, kAlways, kKeeper, Turn::kCalibrations, kImportant},
    {What::kCalibrationRollback, "calibration_rollback", kControl, kNever, kAlways, kKeeper, Turn::kCalibrations,
     kImportant},
    {What::kTrialEnd, "trial_end", kControl, kNever, kAlways, kKeeper, Turn::kCalibrations, kImportant},
    {What::kPull, "pull", kView, kByValues},  // a lossless pull prevents shedding, which affects others
    {What::kPullStop, "pull_stop", kView},    // a host can only name its own streams
    {What::kFrameSet, "frame_set", kView, kNever, kNever, std::nullopt, Turn::kFrameSets},
    {What::kAuditLog, "audit_log", kControl},  // names users and processes
    {What::kHosts, "hosts", kControl},         // names users and processes
    {What::kHostEnd, "host_end", kControl, kNever, kNever, std::nullopt, Turn::kNone, kImportant},
    {What::kDevices, "devices", kControl},  // opens devices
    {What::kTakeStart, "take_start", kControl, kNever, kAlways, kTakes},
    {What::kTakeStop, "take_stop", kControl, kNever, kAlways, kTakes},
    {What::kTakeMark, "take_mark", kControl, kNever, kAlways, kTakes},
    {What::kTakeList, "take_list", kView, kNever, kNever, kTakes},
    {What::kTakeDelete, "take_delete", kControl, kNever, kAlways, kTakes, Turn::kNone, kImportant},
    {What::kTakeProtect, "take_protect", kControl, kNever, kAlways, kTakes},
    {What::kTakeRead, "take_read", kControl, kNever, kNever, std::nullopt, Turn::kTakeReads},
    {What::kDiskTest, "disk_test", kControl, kNever, kAlways, kTakes, Turn::kDiskTest},  // keeps the disk busy
    {What::kDiskEject, "disk_eject", kControl, kNever, kAlways, kTakes},
    {What::WHAT_NOT_SET, "unknown request", kView},
});

/// A request without a row, which a test finds: nobody but a control host may make it.
constexpr RequestKind kUnlisted{What::WHAT_NOT_SET, "request without a row in access.cpp", kControl};

/// Whether the values in a request of Holds::kByValues do what its row says.
bool by_values(const wire::Request& request) {
  if (request.has_genlock()) return request.genlock().action() != wire::GenlockRequest::SHOW;
  if (request.has_exposure()) return request.exposure().ByteSizeLong() > 0;
  return request.pull().lossless();
}

bool holds(Holds what, const wire::Request& request) {
  return what == Holds::kAlways || (what == Holds::kByValues && by_values(request));
}

}  // namespace

std::span<const RequestKind> request_kinds() { return kKinds; }

const RequestKind& kind_of(const wire::Request& request) {
  const auto found = std::ranges::find(kKinds, request.what_case(), &RequestKind::what);
  return found == kKinds.end() ? kUnlisted : *found;
}

bool changes_rig(const wire::Request& request) { return holds(kind_of(request).changes, request); }

Access access_needed(const wire::Request& request) {
  const RequestKind& kind = kind_of(request);
  return holds(kind.control, request) ? Access::kControl : kind.access;
}

Status check_access(Access has, const wire::Request& request) {
  if (has >= access_needed(request)) return {};
  return fail(Errc::kUnsupported, std::string(kind_of(request).name) + (request.has_pull() ? " (lossless)" : "") +
                                      " is not permitted on this rig's view-only link; connect to its control socket");
}

}  // namespace nodal::firmware
