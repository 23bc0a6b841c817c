// The permission of every request in nodal.proto. Each request must appear in this test.
#include "firmware/hosts/access.h"

#include <gtest/gtest.h>

#include <fstream>
#include <map>
#include <regex>
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
    EXPECT_TRUE(check_access(Access::kView, request)) << kind_of(request).name;
  }
  for (const wire::Request& request : forbidden()) {
    const Status refused = check_access(Access::kView, request);
    ASSERT_FALSE(refused) << kind_of(request).name;
    EXPECT_EQ(refused.error().code, Errc::kUnsupported);
    EXPECT_NE(refused.error().message.find(kind_of(request).name), std::string::npos) << refused.error().message;
  }
}

TEST(Access, AControlHost_MayAskEverything) {
  for (const auto& list : {harmless(), forbidden()}) {
    for (const wire::Request& request : list) EXPECT_TRUE(check_access(Access::kControl, request));
  }
}

/// Numbers and names of the requests, as nodal.proto has them: "    StatusRequest status = 10;".
std::map<int, std::string> requests_of_the_protocol() {
  std::ifstream file(NODAL_SOURCE_DIR "/protocol/nodal.proto");
  std::map<int, std::string> found;
  const std::regex field(R"(^\s+\w+ (\w+) = (\d+);.*)");
  bool in_request = false, in_oneof = false;
  for (std::string line; std::getline(file, line);) {
    if (line.starts_with("message Request ")) in_request = true;
    else if (line.starts_with("}")) in_request = false;
    else if (in_request && line.find("oneof what") != std::string::npos) in_oneof = true;
    else if (line.starts_with("  }")) in_oneof = false;
    std::smatch match;
    if (in_request && in_oneof && std::regex_match(line, match, field)) found[std::stoi(match[2])] = match[1];
  }
  return found;
}

TEST(RequestKinds, AreThoseOfTheProtocolByNumberAndName) {
  std::map<int, std::string> listed;
  for (const RequestKind& kind : request_kinds()) {
    if (kind.what == wire::Request::WHAT_NOT_SET) continue;
    EXPECT_TRUE(listed.emplace(kind.what, kind.name).second) << kind.name;
  }
  const auto requests = requests_of_the_protocol();
  ASSERT_GT(requests.size(), 20u);
  EXPECT_EQ(listed, requests) << "a request of nodal.proto needs its row in firmware/hosts/requests.cpp";
}

TEST(RequestKinds, EveryRequestOfTheProtocol_IsInAListOfThisTest) {
  std::set<int> judged;
  for (const auto& list : {harmless(), forbidden()}) {
    for (const wire::Request& request : list) judged.insert(request.what_case());
  }
  for (const auto& [number, name] : requests_of_the_protocol()) EXPECT_TRUE(judged.contains(number)) << name;
}

/// A change of the rig needs control; what waits for a turn is no query of the rig's state.
TEST(RequestKinds, ChangesNeedControlAndNoListWaits) {
  for (const RequestKind& kind : request_kinds()) {
    SCOPED_TRACE(kind.name);
    const bool view = kind.access == Access::kView;
    const bool changes = kind.command && kind.command->changes;
    EXPECT_TRUE(kind.command || kind.answer) << "nothing carries it out";
    EXPECT_EQ(kind.command && kind.answer, kind.command && kind.by_values) << "nothing chooses between the two";
    EXPECT_FALSE(view && changes && !kind.by_values);
    EXPECT_FALSE(kind.command && kind.important) << "a command's own row says so";
    const bool installs = changes && kind.command->stage == CommandStage::kKeeper;
    EXPECT_EQ(installs, kind.turn == Turn::kCalibrations) << "the keeper takes one change at a time";
    EXPECT_TRUE(!view || kind.turn == Turn::kFrameSets || kind.turn == Turn::kNone);
  }
}

TEST(Access, ARequestNobodyKnows_IsLeftToTheAnswerThatSaysSo) {
  EXPECT_TRUE(check_access(Access::kView, wire::Request()));
}

}  // namespace
}  // namespace nodal::firmware
