// `nodal drift` and trials, run as by a user on a filming rig; one of its heads was moved after its calibration.
#include <signal.h>

#include "bumped_rig.h"

namespace nodal::command_line {
namespace {

TEST_F(BumpedRig, Drift_NamesTheHeadThatMovedAndNoOtherAndReregistrationOnTrialPutsItRight) {
  film();
  const Finished finished = nodal({"drift", "--tolerance", "0.2"});
  EXPECT_EQ(finished.code, 8) << finished.err;
  EXPECT_NE(finished.err.find("moved: 'cam3' by 0."), std::string::npos) << finished.err;
  const Json before = drift();
  EXPECT_TRUE(before["moved"].get<bool>());
  for (std::size_t h = 0; h < 6; ++h) {
    const Json& head = before["heads"][h];
    EXPECT_EQ(head["standing"], h == kBumped ? "moved" : "stands") << head;
    EXPECT_NEAR(head["moved_deg"].get<double>(), h == kBumped ? kBumpDeg : 0, 0.03) << head;
  }
  EXPECT_NEAR(before["heads"][kBumped]["right_deg"].get<double>(), kBumpDeg, 0.03);

  const Finished better = nodal({"register", "--trial", "-o", path("found.json")});
  ASSERT_EQ(better.code, 0) << better.err;
  EXPECT_NE(better.out.find("kept: "), std::string::npos) << better.out;
  const std::string found = id_of(parse_calibration(read("found.json")).value());
  EXPECT_EQ(in_force(), found);
  EXPECT_FALSE(on_trial());
  EXPECT_FALSE(drift()["moved"].get<bool>());
  EXPECT_EQ(nodal({"drift", "--tolerance", "0.2"}).code, 0);
  // No frame determines a thousandth of a pixel.
  const Finished unsure = nodal({"drift", "--tolerance", "0.001"});
  EXPECT_EQ(unsure.code, 10) << unsure.err;
  EXPECT_NE(unsure.err.find("cannot tell whether the heads stand as calibrated"), std::string::npos) << unsure.err;
  start_nodald();  // again, on the same store
  EXPECT_TRUE(wait_until([&] { return in_force() == found; }));
}

TEST_F(BumpedRig, WithoutACalibration_ItsFramesAreRegisteredAloneAndByADataSheet) {
  start_nodald();
  ASSERT_EQ(nodal({"genlock", "start"}).code, 0);
  const Calibration truth = bumped(six("truth"), kBumped, kBumpDeg);
  const auto found = [&](Words words) {
    words.insert(words.begin(), "register");
    words.insert(words.end(), {"-o", path("found.json")});
    const Finished run = nodal(words);
    EXPECT_EQ(run.code, 0) << run.err;
    EXPECT_NE(run.out.find("put it in force with: nodal calibration upload " + path("found.json")), std::string::npos)
        << run.out;
    const Calibration calibration = parse_calibration(read("found.json")).value();
    EXPECT_EQ(calibration.heads.front().name, "cam0");
    return test::rotation_error(truth, calibration).rms_deg;
  };
  constexpr double kPixel = 130.0 / kSide;
  Words sheet{"--nominal", "6x130"};
  for (const char* place : {"0,0", "90,0", "180,0", "-90,0", "0,-90,180", "0,90"}) {
    sheet.insert(sheet.end(), {"--at", place});
  }
  EXPECT_LT(found(sheet), 0.3 * kPixel);
  EXPECT_LT(found({}), 0.3 * kPixel);
  const Finished other = nodal({"register", "--nominal", "3x190", "-o", path("no.json")});
  EXPECT_NE(other.code, 0);
  EXPECT_NE(other.err.find("it has 3 heads, and the rig has 6"), std::string::npos) << other.err;
  ASSERT_EQ(nodal({"calibration", "upload", path("found.json")}).code, 0);
  EXPECT_EQ(in_force(), id_of(parse_calibration(read("found.json")).value()));
  // Also when one is in force, the data sheet is the start.
  EXPECT_LT(found(sheet), 0.3 * kPixel);
}

TEST_F(BumpedRig, ATrialThatIsWorse_IsRolledBackAndNotStored) {
  film();
  const Calibration worse = bumped(six("worse"), 0, 1.0);
  const Finished tried = nodal({"calibration", "upload", write("worse.json", to_json(worse)), "--trial"});
  EXPECT_EQ(tried.code, 8) << tried.err;
  EXPECT_NE(tried.err.find("is not better, and the rig uses the previous one again"), std::string::npos) << tried.err;
  EXPECT_EQ(in_force(), id_of(six("six")));
  EXPECT_EQ(nodal_json({"calibration", "list"}).at(0)["calibrations"].size(), 1u);
}

TEST_F(BumpedRig, NodaldIsKilledDuringATrial_TheOldOneIsInForceWhenItIsBack) {
  film();
  const auto trial = start({"register", "--trial", "-o", path("found.json")});
  ASSERT_TRUE(wait_until([&] { return on_trial(); }));
  nodald().signal(SIGKILL);
  EXPECT_NE(trial->wait().code, 0);
  start_nodald();
  EXPECT_TRUE(wait_until([&] { return in_force() == id_of(six("six")); }));
}

TEST_F(BumpedRig, TheHostIsKilledDuringATrial_TheRigGoesBackByItself) {
  film();
  const auto trial = start({"register", "--trial", "--limit", "4s", "--sets", "8", "-o", path("found.json")});
  ASSERT_TRUE(wait_until([&] { return on_trial(); }));
  trial->signal(SIGKILL);
  trial->wait();
  EXPECT_TRUE(wait_until([&] { return !on_trial(); }));
  EXPECT_EQ(in_force(), id_of(six("six")));
}

}  // namespace
}  // namespace nodal::command_line
