// Points decide whether a calibration from pictures replaces the one from points.
#include "stitch/autocalibration/point_check.h"

#include <gtest/gtest.h>

#include "stitch/geometry/head.h"
#include "tests/support/rendered_rig.h"

namespace nodal::autocalibration {
namespace {

std::vector<Match> points_of(const Calibration& rig) {
  const std::vector<geometry::Head> heads = geometry::make_heads(rig).value();
  std::vector<Match> points;
  for (int k = 0; k < 3000; ++k) {
    const double y = 1 - (2 * k + 1.0) / 3000, turn = 2.399963 * k, r = std::sqrt(1 - y * y);
    const geometry::Ray ray = geometry::Ray::towards(r * std::cos(turn), y, r * std::sin(turn));
    for (std::size_t a = 0; a < heads.size(); ++a) {
      for (std::size_t b = a + 1; b < heads.size(); ++b) {
        const auto in_a = heads[a].project(ray), in_b = heads[b].project(ray);
        const bool seen = in_a && in_b && heads[a].contains(*in_a) && heads[b].contains(*in_b);
        // The points are 0.3 px off, to the right or to the left.
        if (seen) points.push_back({a, b, {in_a->x + (k % 2 == 0 ? 0.3 : -0.3), in_a->y}, *in_b});
      }
    }
  }
  return points;
}

TEST(PointCheck, TheSameCalibrationOrOneAHundredthOfADegreeOff_AgreesAsWell) {
  const Calibration rig = test::six_fisheyes(400);
  const std::vector<Match> points = points_of(rig);
  const auto before = point_errors(rig, points), close = point_errors(test::turned(rig, 0.01, 0.01, 3), points);
  ASSERT_TRUE(before && close);
  EXPECT_NEAR(before->back(), 0.3, 0.02);
  EXPECT_TRUE(agrees_as_well(*before, *before));
  EXPECT_TRUE(agrees_as_well(*before, *close));
}

TEST(PointCheck, OneHeadTurnedAwayByAHalfDegree_DoesNot) {
  const Calibration rig = test::six_fisheyes(400);
  Calibration away = rig;
  away.heads[2] = test::turned(rig, 0.5, 0.5, 3).heads[2];
  const std::vector<Match> points = points_of(rig);
  EXPECT_FALSE(agrees_as_well(*point_errors(rig, points), *point_errors(away, points)));
}

}  // namespace
}  // namespace nodal::autocalibration
