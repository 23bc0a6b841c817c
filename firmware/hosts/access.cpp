#include "firmware/hosts/access.h"

namespace nodal::firmware {

bool changes_rig(const wire::Request& request) {
  switch (request.what_case()) {
    case wire::Request::kHeadSet:
    case wire::Request::kUploadCommit:
    case wire::Request::kCalibrationUse:
    case wire::Request::kCalibrationRollback:
    case wire::Request::kTakeStart:
    case wire::Request::kTakeStop:
    case wire::Request::kTakeMark:
    case wire::Request::kTakeDelete:
    case wire::Request::kTakeProtect:
    case wire::Request::kDiskEject:
    case wire::Request::kTrialEnd: return true;
    case wire::Request::kGenlock: return request.genlock().action() != wire::GenlockRequest::SHOW;
    case wire::Request::kExposure: return request.exposure().ByteSizeLong() > 0;
    case wire::Request::kStatus:
    case wire::Request::kHeads:
    case wire::Request::kUploadBegin:
    case wire::Request::kCalibrationList:
    case wire::Request::kCalibrationGet:
    case wire::Request::kPull:
    case wire::Request::kPullStop:
    case wire::Request::kFrameSet:
    case wire::Request::kAuditLog:
    case wire::Request::kHosts:
    case wire::Request::kHostEnd:
    case wire::Request::kDevices:
    case wire::Request::kTakeList:
    case wire::Request::kTakeRead:
    case wire::Request::kDiskTest:
    case wire::Request::WHAT_NOT_SET: return false;
  }
  return true;
}

std::optional<CommandStage> slow_stage(const wire::Request& request) {
  switch (request.what_case()) {
    case wire::Request::kUploadCommit:
    case wire::Request::kCalibrationList:
    case wire::Request::kCalibrationGet:
    case wire::Request::kCalibrationUse:
    case wire::Request::kCalibrationRollback:
    case wire::Request::kTrialEnd: return CommandStage::kKeeper;
    case wire::Request::kTakeStart:
    case wire::Request::kTakeStop:
    case wire::Request::kTakeMark:
    case wire::Request::kTakeList:
    case wire::Request::kTakeDelete:
    case wire::Request::kTakeProtect:
    case wire::Request::kDiskEject:
    case wire::Request::kDiskTest: return CommandStage::kTakes;
    default: return std::nullopt;
  }
}

Access access_needed(const wire::Request& request) {
  switch (request.what_case()) {
    case wire::Request::kStatus:
    case wire::Request::kHeads:
    case wire::Request::kCalibrationList:
    case wire::Request::kCalibrationGet:
    case wire::Request::kPullStop:  // a host can only name its own streams
    case wire::Request::kFrameSet:
    case wire::Request::kTakeList:
    case wire::Request::WHAT_NOT_SET: return Access::kView;  // a request of a newer host; it gets kUnsupported
    case wire::Request::kGenlock:
    case wire::Request::kExposure: return changes_rig(request) ? Access::kControl : Access::kView;
    case wire::Request::kPull:
      return request.pull().lossless() ? Access::kControl
                                       : Access::kView;  // a lossless pull prevents shedding, which affects others
    case wire::Request::kHeadSet:
    case wire::Request::kUploadBegin:
    case wire::Request::kUploadCommit:
    case wire::Request::kCalibrationUse:
    case wire::Request::kCalibrationRollback:
    case wire::Request::kTrialEnd:
    case wire::Request::kTakeStart:
    case wire::Request::kTakeStop:
    case wire::Request::kTakeMark:
    case wire::Request::kTakeDelete:
    case wire::Request::kTakeProtect:
    case wire::Request::kTakeRead:  // the rig sends one file at a time
    case wire::Request::kDiskEject:
    case wire::Request::kDiskTest:  // keeps the disk busy
    case wire::Request::kHostEnd:
    case wire::Request::kDevices:  // opens devices
    case wire::Request::kHosts:    // names users and processes, as the audit log does
    case wire::Request::kAuditLog: return Access::kControl;
  }
  return Access::kControl;
}

std::string_view request_name(const wire::Request& request) {
  switch (request.what_case()) {
    case wire::Request::kStatus: return "status";
    case wire::Request::kHeads: return "heads";
    case wire::Request::kHeadSet: return "head_set";
    case wire::Request::kGenlock: return "genlock";
    case wire::Request::kExposure: return "exposure";
    case wire::Request::kUploadBegin: return "upload_begin";
    case wire::Request::kUploadCommit: return "upload_commit";
    case wire::Request::kCalibrationList: return "calibration_list";
    case wire::Request::kCalibrationGet: return "calibration_get";
    case wire::Request::kCalibrationUse: return "calibration_use";
    case wire::Request::kCalibrationRollback: return "calibration_rollback";
    case wire::Request::kTrialEnd: return "trial_end";
    case wire::Request::kPull: return "pull";
    case wire::Request::kPullStop: return "pull_stop";
    case wire::Request::kFrameSet: return "frame_set";
    case wire::Request::kAuditLog: return "audit_log";
    case wire::Request::kHosts: return "hosts";
    case wire::Request::kHostEnd: return "host_end";
    case wire::Request::kDevices: return "devices";
    case wire::Request::kTakeStart: return "take_start";
    case wire::Request::kTakeStop: return "take_stop";
    case wire::Request::kTakeMark: return "take_mark";
    case wire::Request::kTakeList: return "take_list";
    case wire::Request::kTakeDelete: return "take_delete";
    case wire::Request::kTakeProtect: return "take_protect";
    case wire::Request::kTakeRead: return "take_read";
    case wire::Request::kDiskTest: return "disk_test";
    case wire::Request::kDiskEject: return "disk_eject";
    case wire::Request::WHAT_NOT_SET: break;
  }
  return "unknown request";
}

Status check_access(Access has, const wire::Request& request) {
  if (has >= access_needed(request)) return {};
  return fail(Errc::kUnsupported, std::string(request_name(request)) + (request.has_pull() ? " (lossless)" : "") +
                                      " is not permitted on this rig's view-only link; connect to its control socket");
}

}  // namespace nodal::firmware
