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

struct Row {
  Access least;  ///< the lowest level that may ask it
  wire::Request request;
};

template <class Fill>
Row row(Access least, Fill fill) {
  Row made{least, {}};
  fill(made.request);
  return made;
}

/// Every request of nodal.proto, and the lowest level that may ask it. Written by hand, from what each does.
std::vector<Row> rows() {
  using Request = wire::Request;
  constexpr auto kView = Access::kView;
  constexpr auto kOperate = Access::kOperate;
  constexpr auto kControl = Access::kControl;
  return {
      row(kView, [](Request& r) { r.mutable_status(); }),
      row(kView, [](Request& r) { r.mutable_heads(); }),
      row(kView, [](Request& r) { r.mutable_genlock()->set_action(wire::GenlockRequest::SHOW); }),
      row(kView, [](Request& r) { r.mutable_exposure(); }),
      row(kView, [](Request& r) { r.mutable_calibration_list(); }),
      row(kView, [](Request& r) { r.mutable_calibration_get(); }),
      row(kView, [](Request& r) { r.mutable_pull(); }),
      row(kView, [](Request& r) { r.mutable_pull_stop(); }),
      row(kView, [](Request& r) { r.mutable_frame_set(); }),
      row(kView, [](Request& r) { r.mutable_take_list(); }),
      row(kOperate, [](Request& r) { r.mutable_head_set(); }),
      row(kOperate, [](Request& r) { r.mutable_genlock()->set_action(wire::GenlockRequest::START); }),
      row(kOperate, [](Request& r) { r.mutable_genlock()->set_action(wire::GenlockRequest::STOP); }),
      // A newer host's.
      row(kOperate, [](Request& r) { r.mutable_genlock()->set_action(static_cast<wire::GenlockRequest::Action>(7)); }),
      row(kOperate, [](Request& r) { r.mutable_exposure()->set_locked(false); }),
      row(kOperate, [](Request& r) { r.mutable_take_start(); }),
      row(kOperate, [](Request& r) { r.mutable_take_start()->set_still(true); }),
      row(kOperate, [](Request& r) { r.mutable_take_stop(); }),
      row(kOperate, [](Request& r) { r.mutable_take_mark(); }),
      row(kOperate, [](Request& r) { r.mutable_take_protect(); }),
      row(kOperate, [](Request& r) { r.mutable_take_read(); }),
      row(kControl, [](Request& r) { r.mutable_upload_begin(); }),
      row(kControl, [](Request& r) { r.mutable_upload_commit(); }),
      row(kControl, [](Request& r) { r.mutable_calibration_use(); }),
      row(kControl, [](Request& r) { r.mutable_calibration_rollback(); }),
      row(kControl, [](Request& r) { r.mutable_trial_end(); }),
      row(kControl, [](Request& r) { r.mutable_pull()->set_lossless(true); }),
      row(kControl, [](Request& r) { r.mutable_audit_log(); }),
      row(kControl, [](Request& r) { r.mutable_hosts(); }),
      row(kControl, [](Request& r) { r.mutable_host_end(); }),
      row(kControl, [](Request& r) { r.mutable_devices(); }),
      row(kControl, [](Request& r) { r.mutable_take_delete(); }),
      row(kControl, [](Request& r) { r.mutable_disk_test(); }),
      row(kControl, [](Request& r) { r.mutable_disk_eject(); }),
  };
}

TEST(Access, EveryRequestAtEveryLevel_IsPermittedFromItsOwnOnAndElseRefusedByName) {
  for (const auto& [least, request] : rows()) {
    for (const Access level : kAccessLevels) {
      const std::string_view name = kind_of(request).name;
      SCOPED_TRACE(std::string(name) + " at " + std::string(socket_name(level)));
      const Status checked = check_access(level, request);
      ASSERT_EQ(checked.has_value(), level >= least);
      if (checked) continue;
      EXPECT_EQ(checked.error().code, Errc::kUnsupported);
      EXPECT_NE(checked.error().message.find(name), std::string::npos) << checked.error().message;
      const std::string remedy = "connect to its " + std::string(socket_name(least)) + " socket";
      EXPECT_NE(checked.error().message.find(remedy), std::string::npos) << checked.error().message;
    }
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
  for (const Row& row : rows()) judged.insert(row.request.what_case());
  for (const auto& [number, name] : requests_of_the_protocol()) EXPECT_TRUE(judged.contains(number)) << name;
}

/// A change of the rig needs more than viewing; what waits for a turn is no query of the rig's state.
TEST(RequestKinds, ChangesNeedMoreThanViewAndNoListWaits) {
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
