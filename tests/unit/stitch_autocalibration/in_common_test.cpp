// Whether two pictures have as much in common as a rotation says.
#include "stitch/autocalibration/in_common.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

namespace nodal::autocalibration {
namespace {

constexpr double kRadius = 400;

/// A fisheye's picture of 190 degrees with features in all of its circle.
std::vector<Feature> features_all_over() {
  std::vector<Feature> all;
  for (int i = 0; i < 2000; ++i) {
    const double r = 0.97 * kRadius * std::sqrt((i + 0.5) / 2000), turn = 2.4 * i;  // a sunflower's pattern
    Feature feature{};
    feature.pixel = {kRadius + r * std::cos(turn), kRadius + r * std::sin(turn)};
    all.push_back(feature);
  }
  return all;
}

struct Pair {
  std::vector<Shape> shapes{2, Shape{800, 800, Region::Circle{kRadius, kRadius, kRadius}}};
  std::vector<std::vector<Feature>> features{2, features_all_over()};
  SharedLens lens{{1 / (95 * std::numbers::pi / 180), {}}};
};

TEST(InCommon, HeadsThatLookOneWayButShareOnlyPointsOfTheRim_AreNotTrusted) {
  Pair pair;
  std::vector<Match> matches;
  for (int n = 0; n < 60; ++n) {
    const double turn = 0.1 * n;
    const geometry::Pixel at{kRadius + 0.97 * kRadius * std::cos(turn), kRadius + 0.97 * kRadius * std::sin(turn)};
    matches.push_back({0, 1, at, at});
  }
  const InCommon common(pair.shapes, pair.features, matches);
  EXPECT_EQ(common.agreeing(0, 1, Eigen::Matrix3d::Identity(), pair.lens), 0);
}

TEST(InCommon, HeadsThatLookOneWayAndMatchAllOver_AreTrustedByTheNumberOfMatches) {
  Pair pair;
  std::vector<Match> matches;
  for (std::size_t n = 0; n < 400; ++n) {
    const geometry::Pixel at = pair.features[0][5 * n].pixel;
    matches.push_back({0, 1, at, at});
  }
  const InCommon common(pair.shapes, pair.features, matches);
  EXPECT_EQ(common.agreeing(0, 1, Eigen::Matrix3d::Identity(), pair.lens), 400);
}

TEST(InCommon, MatchesThatTheRotationContradicts_DoNotCount) {
  Pair pair;
  std::vector<Match> matches;
  for (std::size_t n = 0; n < 400; ++n) {  // by a tenth of the radius, five times what counts as agreeing
    const geometry::Pixel at = pair.features[0][5 * n].pixel;
    matches.push_back({0, 1, at, {at.x + 0.1 * kRadius, at.y}});
  }
  for (std::size_t n = 0; n < 200; ++n) {
    const geometry::Pixel at = pair.features[0][5 * n + 1].pixel;
    matches.push_back({0, 1, at, at});
  }
  const InCommon common(pair.shapes, pair.features, matches);
  EXPECT_EQ(common.agreeing(0, 1, Eigen::Matrix3d::Identity(), pair.lens), 200);
}

TEST(InCommon, HeadsBackToBack_NeedNoMoreThanTheirRims) {
  Pair pair;
  std::vector<Match> matches;
  for (int n = 0; n < 20; ++n) {  // at 90 degrees, where a circle of 95 degrees has its radius times 90 / 95
    const double turn = 0.3 * n, r = kRadius * 90 / 95;
    matches.push_back({0,
                       1,
                       {kRadius + r * std::cos(turn), kRadius + r * std::sin(turn)},
                       {kRadius - r * std::cos(turn), kRadius + r * std::sin(turn)}});
  }
  Eigen::Matrix3d back;
  back << -1, 0, 0, 0, 1, 0, 0, 0, -1;
  const InCommon common(pair.shapes, pair.features, matches);
  EXPECT_EQ(common.agreeing(0, 1, back, pair.lens), 20);
}

}  // namespace
}  // namespace nodal::autocalibration
