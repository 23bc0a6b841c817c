// The permission of every request in nodal.proto. Each request must appear in this test.
#include "firmware/hosts/access.h"

#include <gtest/gtest.h>

#include <set>
#include <string>
#include <vector>

namespace nodal::firmware {
namespace {

/// Every kind of request that a view-only host may make, in a form that changes nothing.
std::vector<wire::Request> harmless() {
  std::vector<wire::Request> all(10);
  all[0].mutable_status();
  all[1].mutable_heads();
  all[2].mutable_genlock()->set_action(wire::GenlockRequest::SHOW);
  all[3].mutable_exposure();
  all[4].mutable_calibration_list();
  all[5].mutable_calibration_get();
  all[6].mutable_pull();
  all[7].mutable_pull_stop();
  all[8].mutable_frame_set();
  all[9].mutable_take_list();
  return all;
}

std::vector<wire::Request> forbidden() {
  std::vector<wire::Request> all(23);
  all[0].mutable_head_set();
  all[1].mutable_genlock()->set_action(wire::GenlockRequest::START);
  all[2].mutable_genlock()->set_action(wire::GenlockRequest::STOP);
  all[3].mutable_exposure()->set_locked(false);
  all[4].mutable_upload_begin();
  all[5].mutable_upload_commit();
  all[6].mutable_calibration_use();
  all[7].mutable_calibration_rollback();
  all[8].mutable_trial_end();
  all[9].mutable_pull()->set_lossless(true);
  all[10].mutable_audit_log();
  all[11].mutable_genlock()->set_action(static_cast<wire::GenlockRequest::Action>(7));  // a newer host's
  all[12].mutable_hosts();
  all[13].mutable_host_end();
  all[14].mutable_devices();
  all[15].mutable_take_start();
  all[16].mutable_take_stop();
  all[17].mutable_take_mark();
  all[18].mutable_take_delete();
  all[19].mutable_take_protect();
  all[20].mutable_take_read();
  all[21].mutable_disk_test();
  all[22].mutable_disk_eject();
  return all;
}

TEST(Access, AViewOnlyHost_MayAskHowTheRigIsAndNothingElse) {
  for (const wire::Request& request : harmless()) {
    EXPECT_TRUE(check_access(Access::kView, request)) << request_name(request);
  }
  for (const wire::Request& request : forbidden()) {
    const Status refused = check_access(Access::kView, request);
    ASSERT_FALSE(refused) << request_name(request);
    EXPECT_EQ(refused.error().code, Errc::kUnsupported);
    EXPECT_NE(refused.error().message.find(request_name(request)), std::string::npos) << refused.error().message;
  }
}

TEST(Access, AControlHost_MayAskEverything) {
  for (const auto& list : {harmless(), forbidden()}) {
    for (const wire::Request& request : list) EXPECT_TRUE(check_access(Access::kControl, request));
  }
}

// A request added to nodal.proto does not compile without its lines in access.cpp; this test fails until the request is
// also added here. The numbers are those of the oneof in nodal.proto.
TEST(Access, EveryRequestOfTheProtocol_IsJudgedInThisTest) {
  std::set<int> judged;
  for (const auto& list : {harmless(), forbidden()}) {
    for (const wire::Request& request : list) judged.insert(request.what_case());
  }
  for (int number = 1; number < 200; ++number) {
    // An empty message in field `number`: a request if the oneof has that number, else an unknown field.
    const int tag = number << 3 | 2;
    std::string bytes;
    bytes.push_back(static_cast<char>(tag < 128 ? tag : (tag & 127) | 128));
    if (tag >= 128) bytes.push_back(static_cast<char>(tag >> 7));
    bytes.push_back('\0');
    wire::Request request;
    if (!request.ParseFromString(bytes) || request.what_case() == wire::Request::WHAT_NOT_SET) continue;
    EXPECT_TRUE(judged.contains(number)) << "request " << number << " is in no list of this test";
  }
}

TEST(Access, ARequestNobodyKnows_IsLeftToTheAnswerThatSaysSo) {
  EXPECT_TRUE(check_access(Access::kView, wire::Request()));
}

}  // namespace
}  // namespace nodal::firmware
