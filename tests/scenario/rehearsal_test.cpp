// Uploads that a process of its own parses and compiles first: what it finds, and what ends it, is the answer; the rig
// goes on.
#include <gtest/gtest.h>

#include "firmware/calibration/rehearsal.h"
#include "hal/sim/confined.h"
#include "tests/scenario/stand.h"

namespace nodal::scenario {
namespace {

/// A rig with such a process, simulated. `error`: what ends it; none: it does its work.
struct Rehearsed {
  StandOptions options;
  std::optional<Error> error;
  hal::sim::SimConfined port{[this](const hal::ConfinedJob& job, const hal::ConfinedProgress& progress) {
    if (error) return Result<std::vector<std::uint8_t>>(fail(*error));
    return firmware::rehearse(options.config, job, progress);
  }};
  std::unique_ptr<Stand> stand = [this] {
    options.rehearsal = &port;
    return std::make_unique<Stand>(options);
  }();
};

TEST(CalibrationRehearsal, CrashesHangsOrNeedsTooMuch_IsAnAnswerAndTheNextUploadIsInstalled) {
  Rehearsed rig;
  TestHost& host = rig.stand->bring_up();
  EXPECT_EQ(rig.port.begun(), 1);
  const std::string in_force = host.status().calibration_id();
  for (const Error& error :
       {Error{Errc::kInternal, "crashed (signal 11)"}, Error{Errc::kOverload, "made no progress for 60 s"},
        Error{Errc::kOverload, "needs more than 320 MiB of memory"}}) {
    rig.error = error;
    const wire::Reply refused = host.upload(to_json(small_calibration("refused")));
    ASSERT_TRUE(refused.has_error());
    EXPECT_NE(refused.error().message().find(error.message), std::string::npos) << refused.error().message();
    EXPECT_EQ(host.status().calibration_id(), in_force);
  }
  rig.error.reset();
  const wire::Reply taken = host.upload(to_json(small_calibration("taken")));
  EXPECT_FALSE(taken.has_error()) << taken.error().message();
  EXPECT_NE(host.status().calibration_id(), in_force);
}

TEST(CalibrationRehearsal, DocumentThatIsWrong_IsRefusedByItWithTheReason) {
  Rehearsed rig;
  TestHost& host = rig.stand->bring_up();
  Calibration unknown = small_calibration("unknown");
  unknown.heads[0].name = "nobody";
  const wire::Reply other_heads = host.upload(to_json(unknown));
  ASSERT_TRUE(other_heads.has_error());
  EXPECT_NE(other_heads.error().message().find("cam0"), std::string::npos) << other_heads.error().message();
  const wire::Reply no_json = host.upload("{\"nodal_calibration\": 1");
  ASSERT_TRUE(no_json.has_error());
  EXPECT_NE(no_json.error().message().find("ends too early"), std::string::npos) << no_json.error().message();
  EXPECT_EQ(rig.port.begun(), 3);
}

/// Thin masks along the diagonal of every head, so that the box of each is the whole picture.
Calibration long_to_compile() {
  Calibration rig = small_calibration("long");
  for (HeadCalibration& head : rig.heads) {
    for (int m = 0; m < 16; ++m) {
      std::vector<Region::Point> mask;
      const double step = (head.width - 4) / 7.0;
      for (int k = 0; k < 8; ++k) mask.push_back({1.0 + m * 0.1 + k * step, 1 + k * step});
      for (int k = 7; k >= 0; --k) mask.push_back({1.05 + m * 0.1 + k * step, 1.02 + k * step});
      head.region.masks.push_back(std::move(mask));
    }
  }
  return rig;
}

TEST(CalibrationRehearsal, WorkAboveTheBudget_IsRefusedBeforeARowIsCompiled) {
  Rehearsed rig;
  TestHost& host = rig.stand->bring_up();
  const wire::Reply refused = host.upload(to_json(long_to_compile()));
  ASSERT_TRUE(refused.has_error());
  EXPECT_EQ(rig.port.begun(), 2) << "it was the worker that refused";
  EXPECT_NE(refused.error().message().find("million steps"), std::string::npos) << refused.error().message();
  EXPECT_EQ(rig.port.progress(), 0U);
}

TEST(CalibrationRehearsal, WhileOneRuns_ListsAreAnsweredAndTheUploadIsNot) {
  Rehearsed rig;
  TestHost& host = rig.stand->bring_up();
  rig.port.hold();
  const std::string document = to_json(small_calibration("first"));
  (void)host.send_document(document);
  wire::Request commit, list;
  *commit.mutable_upload_commit() =
      UploadSender(std::make_shared<const std::vector<std::uint8_t>>(document.begin(), document.end())).commit();
  rig.stand->run(Duration::seconds(1));
  const std::uint64_t first = host.post(commit);
  list.mutable_calibration_list();
  EXPECT_TRUE(rig.stand->connect().ask(list).has_calibrations());
  EXPECT_EQ(host.reply(first), nullptr);
  rig.port.hold(false);
  EXPECT_TRUE(rig.stand->run_until([&] { return host.reply(first) != nullptr; }));
}

}  // namespace
}  // namespace nodal::scenario
