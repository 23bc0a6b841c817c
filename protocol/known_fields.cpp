#include "protocol/known_fields.h"

#include <string>

namespace nodal {
namespace {

/// protobuf's lite messages have no public function for their unknown fields, so this names the protected member that
/// holds them. The member is the same in every message: a new field of a request needs no change here.
struct Unknown : google::protobuf::MessageLite {
  static constexpr auto kMember = &Unknown::_internal_metadata_;
};

/// Frees the memory too; clear() would keep it.
void drop(google::protobuf::MessageLite* message) {
  auto& metadata = message->*Unknown::kMember;
  if (metadata.have_unknown_fields()) std::string().swap(*metadata.mutable_unknown_fields<std::string>());
}

}  // namespace

// No default case, so that the compiler warns about a request that is missing here.
void drop_unknown_fields(wire::Request& request) {
  drop(&request);
  switch (request.what_case()) {
    case wire::Request::kStatus: return drop(request.mutable_status());
    case wire::Request::kHeads: return drop(request.mutable_heads());
    case wire::Request::kHeadSet: return drop(request.mutable_head_set());
    case wire::Request::kGenlock: return drop(request.mutable_genlock());
    case wire::Request::kExposure: return drop(request.mutable_exposure());
    case wire::Request::kUploadBegin: return drop(request.mutable_upload_begin());
    case wire::Request::kUploadCommit: return drop(request.mutable_upload_commit());
    case wire::Request::kCalibrationList: return drop(request.mutable_calibration_list());
    case wire::Request::kCalibrationGet: return drop(request.mutable_calibration_get());
    case wire::Request::kCalibrationUse: return drop(request.mutable_calibration_use());
    case wire::Request::kCalibrationRollback: return drop(request.mutable_calibration_rollback());
    case wire::Request::kTrialEnd: return drop(request.mutable_trial_end());
    case wire::Request::kPull: return drop(request.mutable_pull());
    case wire::Request::kPullStop: return drop(request.mutable_pull_stop());
    case wire::Request::kFrameSet: return drop(request.mutable_frame_set());
    case wire::Request::kAuditLog: return drop(request.mutable_audit_log());
    case wire::Request::kHosts: return drop(request.mutable_hosts());
    case wire::Request::kHostEnd: return drop(request.mutable_host_end());
    case wire::Request::kDevices: return drop(request.mutable_devices());
    case wire::Request::kTakeStart: return drop(request.mutable_take_start());
    case wire::Request::kTakeStop: return drop(request.mutable_take_stop());
    case wire::Request::kTakeMark: return drop(request.mutable_take_mark());
    case wire::Request::kTakeList: return drop(request.mutable_take_list());
    case wire::Request::kTakeDelete: return drop(request.mutable_take_delete());
    case wire::Request::kTakeProtect: return drop(request.mutable_take_protect());
    case wire::Request::kTakeRead: return drop(request.mutable_take_read());
    case wire::Request::kDiskTest: return drop(request.mutable_disk_test());
    case wire::Request::kDiskEject: return drop(request.mutable_disk_eject());
    case wire::Request::WHAT_NOT_SET: return;
  }
}

}  // namespace nodal
