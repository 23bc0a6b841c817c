// Pairs of fisheyes back to back from their pictures alone: a short form of bench_from_pictures --pairs.
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>

#include "tests/bench/fisheye_pairs.h"

namespace nodal::bench {
namespace {

class FisheyePairs : public testing::Test {
 protected:
  /// Tests run side by side.
  static std::filesystem::path own_folder() {
    return std::filesystem::path(testing::TempDir()) /
           (std::string("nodal-") + testing::UnitTest::GetInstance()->current_test_info()->name());
  }
  static PairVerdict judged(FisheyePair pair, int seed, int side = 480) {
    pair.side = side;
    const Calibration truth = true_pair(pair, seed);
    const auto folder = own_folder();
    const auto files = written(rendered_pair(pair, truth, seed), folder);
    EXPECT_TRUE(files) << files.error().text();
    PairVerdict verdict = files ? judged_alone(pair, truth, *files) : PairVerdict{};
    std::filesystem::remove_all(folder);
    return verdict;
  }
  static PairVerdict judged_by_sheet(const FisheyePair& pair, int seed, const NominalAsked& asked) {
    const Calibration truth = true_pair(pair, seed);
    const auto folder = own_folder();
    const auto files = written(rendered_pair(pair, truth, seed), folder);
    EXPECT_TRUE(files) << files.error().text();
    PairVerdict verdict = files ? judged_nominal(pair, truth, *files, asked) : PairVerdict{};
    std::filesystem::remove_all(folder);
    return verdict;
  }
  static void expect_true_claims(const PairVerdict& verdict) {
    ASSERT_EQ(verdict.refused, "");
    EXPECT_LE(verdict.errors.worst_known, 3) << "from " << verdict.known_from_px << " to " << verdict.known_to_px;
    if (verdict.errors.worst > 3) {
      EXPECT_FALSE(verdict.whole);
      EXPECT_LE(verdict.errors.worst, verdict.unsure_percent);
      EXPECT_TRUE(std::ranges::any_of(verdict.notes, [&](const std::string& note) {
        return note.find("the lens is known") != std::string::npos && note.find("--nominal") != std::string::npos;
      }));
    }
    EXPECT_LT(verdict.errors.rotation_deg, 1);
  }
};

TEST_F(FisheyePairs, EquidistantLensesInATown_AreRightWhereTheySayThatTheyAre) {
  expect_true_claims(judged({"equidistant", "town", 205, true}, 1));
}

TEST_F(FisheyePairs, EquisolidLensesInARoomWithColumns_AreRightWhereTheySayThatTheyAre) {
  expect_true_claims(judged({"equisolid", "near", 215, false}, 2));
}

TEST_F(FisheyePairs, StereographicLensesWithAThinOverlap_AreRightWhereTheySayThatTheyAre) {
  expect_true_claims(judged({"stereographic", "town", 195, false}, 3));
}

// The overlap is 5 degrees, 19 px wide: inside the circle hardly a descriptor has room there.
TEST_F(FisheyePairs, EquidistantLensesOf185Degrees_ArePlacedByTheirRims) {
  expect_true_claims(judged({"equidistant", "town", 185, false}, 36, 720));
}

TEST_F(FisheyePairs, TilesThatRepeat_AreNamedAsTheCause) {
  const PairVerdict verdict = judged({"equidistant", "tiles", 210, false}, 4);
  EXPECT_NE(verdict.refused.find("repeat"), std::string::npos) << verdict.refused;
  EXPECT_NE(verdict.refused.find("--nominal"), std::string::npos) << verdict.refused;
}

// As `nodal register --nominal 2x205 --lens stereographic`, and without the kind of lens.
TEST_F(FisheyePairs, ADataSheetWithTheKindOfLens_PlacesWhatOneWithoutItDoesNot) {
  const FisheyePair pair{"stereographic", "town", 205, false, 480};
  const PairVerdict with = judged_by_sheet(pair, 3, {.family = true}), without = judged_by_sheet(pair, 3, {});
  ASSERT_EQ(with.refused, "");
  EXPECT_LT(with.errors.worst, 1) << "circles of 230 px are found to about a pixel";
  EXPECT_LT(with.errors.rotation_deg, 0.3);
  EXPECT_TRUE(!without.refused.empty() || without.errors.worst > 3);
  // Nothing is near in this town; what is left is that the circles are found to a fraction of a pixel.
  for (const std::string& note : with.notes) {
    if (note.find("near things") == std::string::npos) continue;
    EXPECT_NE(note.find("their lenses may not be quite the calibration's"), std::string::npos) << note;
  }
}

// Near things made one focal length 10 % too long and the other one too short, which these lenses fit as well.
TEST_F(FisheyePairs, ADataSheetsStereographicLensesInARoom_DoNotDriftApart) {
  const PairVerdict verdict = judged_by_sheet(pair_of(10), 10, {.family = true, .lenses = true});
  ASSERT_EQ(verdict.refused, "");
  EXPECT_LE(verdict.errors.worst_known, 3);
  EXPECT_LT(verdict.errors.worst, 3);
}

// They share 1 degree: a few pixels of their rims, in which no feature can be found.
TEST_F(FisheyePairs, AnOverlapWithoutFeatures_IsRefusedAndRepetitionIsNotNamed) {
  const PairVerdict verdict = judged({"equidistant", "town", 181, false}, 5);
  EXPECT_NE(verdict.refused, "");
  EXPECT_EQ(verdict.refused.find("repeat"), std::string::npos) << verdict.refused;
  EXPECT_NE(verdict.refused.find("--nominal"), std::string::npos) << verdict.refused;
}

}  // namespace
}  // namespace nodal::bench
