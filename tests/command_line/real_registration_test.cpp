// `nodal register` on a real rig, starting from its data sheet only.
#include <gtest/gtest.h>

#include <filesystem>
#include <nlohmann/json.hpp>

#include "tests/support/pictures.h"
#include "tests/support/process.h"

namespace nodal::command_line {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

TEST(RealRegistration, ThreeFisheyesFromTheDataSheet_DifferLessThanWithTheShippedCalibration) {
  const fs::path rig = fs::path(NODAL_SHARED_DIR) / "data" / "stitchem_3cam";
  if (!fs::exists(rig / "input-00.jpg")) GTEST_SKIP() << rig << " is not there: no real rig is registered";
  const test::TemporaryFolder folder;
  const std::string nodal = NODAL_BIN_DIR "/nodal", shipped = (folder / "shipped.json").string();
  const std::vector<std::string> pictures{rig / "input-00.jpg", rig / "input-01.jpg", rig / "input-02.jpg"};
  const auto run = [&](std::vector<std::string> words) {
    words.insert(words.begin(), nodal);
    return test::Process(words).wait(std::chrono::seconds(110));
  };
  const auto register_it = [&](std::vector<std::string> words) {
    words.insert(words.begin(), "register");
    words.insert(words.end(), pictures.begin(), pictures.end());
    // With one raymap size, so that the two figures are comparable.
    for (const char* word : {"--vignetting", "fixed", "--no-search", "--width", "2048", "--json", "-o"})
      words.emplace_back(word);
    words.push_back((folder / "found.json").string());
    const test::Finished done = run(words);
    EXPECT_EQ(done.code, 0) << done.err;
    return done.code == 0 ? json::parse(done.out) : json();
  };
  ASSERT_EQ(run({"import", rig / "3_Cam_-_Sample.pts", "-o", shipped}).code, 0);
  const json by_maker = register_it({shipped});
  const json by_data_sheet =
      register_it({"--nominal", "3x230", "--circle", "1920,1080,1587", "--roll", "90", "--free", "lens"});
  ASSERT_TRUE(by_maker.is_object() && by_data_sheet.is_object());
  EXPECT_LE(by_data_sheet["objective_after"].get<double>(), by_maker["objective_before"].get<double>());
  for (const json& head : by_data_sheet["heads"]) EXPECT_TRUE(head["placed"].get<bool>()) << head["why_not"];
}

/// Its lenses are a few pixels off where two heads overlap, so that fine detail does not line up there; coarser does.
void expect_registered(const test::Finished& done, const std::string& free) {
  ASSERT_EQ(done.code, 0) << free << ": " << done.err;
  const json report = json::parse(done.out);
  EXPECT_LT(report["objective_after"].get<double>(), 0.75 * report["objective_before"].get<double>()) << free;
  for (const json& head : report["heads"]) EXPECT_TRUE(head["placed"].get<bool>()) << free << head["why_not"];
  EXPECT_NE(done.err.find("do not line up in fine detail"), std::string::npos) << done.err;
}

TEST(RealRegistration, APtguiProject_RegistersWithItsLenses) {
  const fs::path rig = fs::path(NODAL_SHARED_DIR) / "data" / "stitchem_3cam";
  if (!fs::exists(rig / "input-00.jpg")) GTEST_SKIP() << rig << " is not there: no real rig is registered";
  const test::TemporaryFolder folder;
  const std::string nodal = NODAL_BIN_DIR "/nodal", shipped = (folder / "shipped.json").string();
  ASSERT_EQ(test::Process({nodal, "import", rig / "3_Cam_-_Sample.pts", "-o", shipped}).wait().code, 0);
  for (const char* free : {"focals", "lens"}) {
    const test::Finished done =
        test::Process({nodal, "--json", "register", shipped, rig / "input-00.jpg", rig / "input-01.jpg",
                       rig / "input-02.jpg", "--free", free, "-o", (folder / "found.json").string()})
            .wait(std::chrono::seconds(110));
    ASSERT_NO_FATAL_FAILURE(expect_registered(done, free));
  }
}

// The project's rotations are up to 1.8 degrees from where the pictures agree.
TEST(RealRegistration, APtguiProject_RegistersItsRotationsAndDriftSaysWhatThatMends) {
  const fs::path rig = fs::path(NODAL_SHARED_DIR) / "data" / "stitchem_3cam";
  if (!fs::exists(rig / "input-00.jpg")) GTEST_SKIP() << rig << " is not there: no real rig is compared";
  const test::TemporaryFolder folder;
  const std::string nodal = NODAL_BIN_DIR "/nodal";
  const std::string shipped = (folder / "shipped.json").string(), found = (folder / "found.json").string();
  const std::vector<std::string> pictures{rig / "input-00.jpg", rig / "input-01.jpg", rig / "input-02.jpg"};
  const auto run = [&](std::vector<std::string> words) {
    words.insert(words.begin(), {nodal, "--json"});
    words.insert(words.end(), pictures.begin(), pictures.end());
    return test::Process(words).wait(std::chrono::seconds(110));
  };
  ASSERT_EQ(test::Process({nodal, "import", rig / "3_Cam_-_Sample.pts", "-o", shipped}).wait().code, 0);
  const test::Finished before = run({"drift", shipped});
  ASSERT_EQ(before.code, 8) << before.err;
  EXPECT_EQ(json::parse(before.out)["heads"][0]["standing"], "moved") << before.out;
  ASSERT_NO_FATAL_FAILURE(expect_registered(run({"register", shipped, "-o", found}), "rotations"));
  const test::Finished after = run({"drift", found});
  // Where fine detail does not line up, a head may settle a tenth of a degree farther on, and then counts as moved,
  // or it cannot be told whether it has moved.
  ASSERT_TRUE(after.code == 0 || after.code == 8 || after.code == 10) << after.err;
  const json was = json::parse(before.out)["heads"], is = json::parse(after.out)["heads"];
  for (std::size_t h = 0; h < 3; ++h) {
    EXPECT_LT(is[h]["moved_deg"].get<double>(), 0.3 * was[h]["moved_deg"].get<double>()) << h << ": " << after.out;
  }
}

/// The mean squared difference between heads when only their light is fitted, and the residuals of the pairs: the same
/// measure for every calibration.
json judged(const std::string& calibration, const std::vector<std::string>& pictures, const std::string& scratch) {
  std::vector<std::string> words{NODAL_BIN_DIR "/nodal", "--json", "register", calibration, "--free", "light",
                                 "--vignetting",         "own",    "--width",  "2048",      "-o",     scratch};
  words.insert(words.end(), pictures.begin(), pictures.end());
  const test::Finished done = test::Process(words).wait(std::chrono::seconds(110));
  EXPECT_EQ(done.code, 0) << done.err;
  return done.code == 0 ? json::parse(done.out) : json();
}

TEST(RealRegistration, ThreeFisheyesFromTheDataSheetAlone_EverySeamLinesUpBetterThanTheShippedCalibrations) {
  const fs::path rig = fs::path(NODAL_SHARED_DIR) / "data" / "stitchem_3cam";
  if (!fs::exists(rig / "input-00.jpg")) GTEST_SKIP() << rig << " is not there: no real rig is registered";
  const test::TemporaryFolder folder;
  const std::string shipped = (folder / "shipped.json").string(), found = (folder / "found.json").string();
  const std::vector<std::string> pictures{rig / "input-00.jpg", rig / "input-01.jpg", rig / "input-02.jpg"};
  ASSERT_EQ(test::Process({NODAL_BIN_DIR "/nodal", "import", rig / "3_Cam_-_Sample.pts", "-o", shipped})
                .wait(std::chrono::seconds(20))
                .code,
            0);
  const json by_maker = judged(shipped, pictures, (folder / "judged.json").string());
  std::vector<std::string> words{NODAL_BIN_DIR "/nodal",
                                 "register",
                                 "--nominal",
                                 "3x230",
                                 "--circle",
                                 "1920,1080,1587",
                                 "--roll",
                                 "90",
                                 "--free",
                                 "lens",
                                 "-o",
                                 found};
  words.insert(words.end(), pictures.begin(), pictures.end());
  const test::Finished done = test::Process(words).wait(std::chrono::seconds(360));
  ASSERT_EQ(done.code, 0) << done.err;
  const json by_us = judged(found, pictures, (folder / "judged.json").string());
  EXPECT_LT(by_us["objective_after"].get<double>(), by_maker["objective_after"].get<double>());
  for (std::size_t pair = 0; pair < 3; ++pair) {  // fine detail is aligned at every seam, also for rows of windows
    EXPECT_GT(by_us["pairs"][pair]["agreement"].get<double>(), 0.3);
    EXPECT_GT(by_us["pairs"][pair]["agreement"].get<double>(), by_maker["pairs"][pair]["agreement"].get<double>());
  }
}

TEST(RealRegistration, TwoFisheyesBackToBack_AreNotPlacedByTheirRimsButTheirExposureSeamGoes) {
  const fs::path rig = fs::path(NODAL_SHARED_DIR) / "data" / "gopro_fusion" / "testframes" / "3k" / "single";
  if (!fs::exists(rig / "FR" / "GPFR0003_img1.jpg")) GTEST_SKIP() << rig << " is not there: no real rig is registered";
  const test::TemporaryFolder folder;
  const auto run = [&](const std::string& free) {
    // The circle and the field of view from the maker's data sheet.
    return test::Process({NODAL_BIN_DIR "/nodal", "--json", "register", "--nominal", "2x190", "--circle", "779,742,765",
                          "--free", free, "-o", (folder / "found.json").string(), rig / "FR" / "GPFR0003_img1.jpg",
                          rig / "BK" / "GPBK0003_img1.jpg"})
        .wait(std::chrono::seconds(110));
  };
  // A hand, a sleeve and a book cross the rims; each lens sees them from its own position.
  const test::Finished placed = run("rotations");
  EXPECT_EQ(placed.code, 4) << placed.out;
  EXPECT_FALSE(fs::exists(folder / "found.json"));
  const test::Finished lit = run("light");
  ASSERT_EQ(lit.code, 0) << lit.err;
  const json answer = json::parse(lit.out);
  EXPECT_LT(answer["objective_after"].get<double>(), 0.5 * answer["objective_before"].get<double>());
  for (const json& head : answer["heads"]) EXPECT_NEAR(head["turned_deg"].get<double>(), 0, 1e-9);
}

}  // namespace
}  // namespace nodal::command_line
