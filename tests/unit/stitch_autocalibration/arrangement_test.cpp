// Lens and rotations from matches of known rigs: the same rays projected into the heads, and wrong matches among them.
#include "stitch/autocalibration/arrangement.h"

#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <random>

#include "protocol/base/angles.h"
#include "stitch/geometry/head.h"
#include "stitch/geometry/rotation.h"
#include "tests/support/rendered_rig.h"
#include "tests/support/rigs.h"

namespace nodal::autocalibration {
namespace {

std::vector<Shape> shapes_of(const Calibration& rig) {
  std::vector<Shape> shapes;
  for (const HeadCalibration& head : rig.heads) shapes.push_back({head.width, head.height, head.region.circle});
  return shapes;
}

struct Errors {
  double noise_px = 0.5;
  double wrong = 0;  ///< share of matches that join any two points
};

std::vector<Match> matches_of(const Calibration& truth, int rays, const Errors& errors, std::uint64_t seed = 1) {
  const std::vector<geometry::Head> heads = geometry::make_heads(truth).value();
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> unit(0, 1);
  std::vector<Match> matches;
  for (int k = 0; k < rays; ++k) {
    const double x = normal(random), y = normal(random), z = normal(random);
    const geometry::Ray ray = geometry::Ray::towards(x, y, z);
    std::vector<std::optional<geometry::Pixel>> seen;
    for (const geometry::Head& head : heads) {
      const auto at = head.project(ray);
      seen.emplace_back();
      if (!at || !head.contains(*at)) continue;
      const double dx = errors.noise_px * normal(random), dy = errors.noise_px * normal(random);
      seen.back() = geometry::Pixel{at->x + dx, at->y + dy};
    }
    for (std::size_t a = 0; a < heads.size(); ++a) {
      for (std::size_t b = a + 1; b < heads.size(); ++b) {
        if (!seen[a] || !seen[b]) continue;
        Match match{a, b, *seen[a], *seen[b]};
        if (unit(random) < errors.wrong) {
          match.pixel_b = {(0.1 + 0.8 * unit(random)) * heads[b].width(),
                           (0.1 + 0.8 * unit(random)) * heads[b].height()};
        }
        matches.push_back(match);
      }
    }
  }
  return matches;
}

Calibration with_rotations(Calibration rig, const Arrangement& found) {
  for (std::size_t h = 0; h < rig.heads.size(); ++h) {
    if (found.R_head_rig[h]) rig.heads[h].R_head_rig = geometry::rows_of(*found.R_head_rig[h]);
  }
  return rig;
}

/// The angle at `radius` units by the lens that was found.
double angle_at(const SharedLens& lens, double radius) {
  double low = 0, high = 2.5;
  for (int k = 0; k < 60; ++k) {
    const double a = (low + high) / 2;
    const double r = lens.model.focal * (a + lens.model.k[0] * std::pow(a, 3) + lens.model.k[1] * std::pow(a, 5));
    (r < radius ? low : high) = a;
  }
  return low;
}

/// An arc of narrow pictures. Each match has an error of its own, and all matches of two pictures have one in common:
/// one picture is larger than the other by `common`, a standard deviation, as near things make it.
Result<Arrangement> narrow_arc(double common, std::uint64_t seed) {
  Calibration truth;
  for (int h = 0; h < 12; ++h) {
    truth.heads.push_back(test::plain_head("p" + std::to_string(h), 640, 360, 7 * h - 38, 26));
  }
  std::vector<Match> matches = matches_of(truth, 400000, {}, seed);
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  std::map<std::pair<std::size_t, std::size_t>, double> scales;
  for (Match& match : matches) {
    const double scale = scales.try_emplace({match.a, match.b}, 1 + common * normal(random)).first->second;
    match.pixel_b = {320 + scale * (match.pixel_b.x - 320), 180 + scale * (match.pixel_b.y - 180)};
  }
  return find_arrangement(shapes_of(truth), matches, 2);
}

TEST(Arrangement, ErrorsThatTwoPicturesHaveInCommon_MakeTheLensLessCertain) {
  constexpr double kEdge = 13 * kRadiansPerDegree;
  double unsure = 0, unsure_in_common = 0;
  for (const std::uint64_t seed : {1, 3}) {
    const Result<Arrangement> own = narrow_arc(0, seed), common = narrow_arc(0.01, seed);
    ASSERT_TRUE(own && common);
    for (const Arrangement* found : {&*own, &*common}) {
      EXPECT_LT(std::abs(angle_at(found->lens, 1) / kEdge - 1), found->evidence.unsure) << "seed " << seed;
    }
    unsure += own->evidence.unsure;
    unsure_in_common += common->evidence.unsure;
  }
  // By the covariance of the fits alone, which takes all errors for independent, it is 1.8 times.
  EXPECT_GT(unsure_in_common, 3 * unsure);
}

TEST(Arrangement, RectilinearRing_LensAndRotationsWithHalfOfTheMatchesWrong) {
  Calibration truth = test::ring(8, 640, 480);
  for (std::size_t h = 0; h < 8; ++h) {
    truth.heads[h] = test::plain_head("cam" + std::to_string(h), 640, 480, 45.0 * static_cast<double>(h), 70);
  }
  const auto found = find_arrangement(shapes_of(truth), matches_of(truth, 1500, {0.5, 0.5}), 0);
  ASSERT_TRUE(found) << found.error().text();
  EXPECT_LT(test::rotation_error(truth, with_rotations(truth, *found)).max_deg, 0.1);
  EXPECT_NEAR(angle_at(found->lens, 1) / kRadiansPerDegree, 35, 0.15);
  EXPECT_EQ(found->lens.aspect, 1) << "640x480 has square pixels";
  // Half of the matches are right, give or take some that agree by chance.
  const double share =
      static_cast<double>(found->used.size()) / static_cast<double>(matches_of(truth, 1500, {0.5, 0.5}).size());
  EXPECT_NEAR(share, 0.5, 0.05);
}

TEST(Arrangement, FisheyesWithCircles_FieldOfViewToAFractionOfADegree) {
  for (const double view_deg : {130.0, 185.0, 220.0}) {
    const Calibration truth = test::six_fisheyes(800, view_deg);
    const auto found = find_arrangement(shapes_of(truth), matches_of(truth, 800, {0.5, 0.3}), 0);
    ASSERT_TRUE(found) << found.error().text();
    EXPECT_LT(test::rotation_error(truth, with_rotations(truth, *found)).max_deg, 0.15) << view_deg;
    EXPECT_NEAR(2 * angle_at(found->lens, 1) / kRadiansPerDegree, view_deg, 1) << view_deg;
  }
}

TEST(Arrangement, HeadsAtAnyRotation_AreFound) {
  const Calibration truth = test::turned(test::six_fisheyes(600, 150), 20, 180, 9);
  const auto found = find_arrangement(shapes_of(truth), matches_of(truth, 600, {}), 0);
  ASSERT_TRUE(found) << found.error().text();
  EXPECT_LT(test::rotation_error(truth, with_rotations(truth, *found)).max_deg, 0.1);
}

TEST(Arrangement, PixelsOfNtsc_AspectIsFound) {
  // A head along each axis of the rig; a level ring alone would not determine the aspect.
  Calibration truth = test::six_fisheyes(480);
  for (HeadCalibration& head : truth.heads) {
    const auto R = head.R_head_rig;
    head = test::plain_head(head.name, 720, 480, 0, 110);
    head.aspect = 1.083;
    head.R_head_rig = R;
  }
  const auto found = find_arrangement(shapes_of(truth), matches_of(truth, 3000, {}), 0);
  ASSERT_TRUE(found) << found.error().text();
  EXPECT_NEAR(found->lens.aspect, 1.083, 0.005);
  EXPECT_LT(test::rotation_error(truth, with_rotations(truth, *found)).max_deg, 0.15);
}

TEST(Arrangement, AxisBesideTheCenter_IsFound) {
  Calibration truth = test::six_fisheyes(800, 150);
  const std::vector<Shape> shapes = shapes_of(truth);
  for (HeadCalibration& head : truth.heads) {
    head.center_x += 12;
    head.center_y -= 8;
    head.region.circle->radius -= 20;  // the lens still covers the region
  }
  const auto found = find_arrangement(shapes, matches_of(truth, 800, {0.3, 0}), 0);
  ASSERT_TRUE(found) << found.error().text();
  EXPECT_NEAR(found->lens.shift.x() * shapes.front().unit(), 12, 1);
  EXPECT_NEAR(found->lens.shift.y() * shapes.front().unit(), -8, 1);
}

TEST(Arrangement, APictureOfSomethingElse_IsNotPlacedAndChangesNothing) {
  const Calibration truth = test::six_fisheyes(600, 150);
  std::vector<Match> matches = matches_of(truth, 600, {});
  std::vector<Shape> shapes = shapes_of(truth);
  shapes.push_back(shapes.front());
  std::mt19937_64 random(3);
  std::uniform_real_distribution<double> anywhere(100, 500);
  // As many wrong matches with every head as right ones.
  for (std::size_t a = 0; a < 6; ++a) {
    for (int k = 0; k < 200; ++k) {
      const double x = anywhere(random), y = anywhere(random), u = anywhere(random), v = anywhere(random);
      matches.push_back({a, 6, {x, y}, {u, v}});
    }
  }
  const auto found = find_arrangement(shapes, matches, 0);
  ASSERT_TRUE(found) << found.error().text();
  EXPECT_FALSE(found->R_head_rig[6]);
  EXPECT_LT(test::rotation_error(truth, with_rotations(truth, *found)).max_deg, 0.1);
}

TEST(Arrangement, ThingsThatRepeat_DeceiveMatchesButNotThePictures) {
  const Calibration truth = test::six_fisheyes(600, 150);
  std::vector<Match> matches = matches_of(truth, 250, {});
  // The first two heads seem to have more in common with a wrong rotation than with the right one.
  Calibration wrong = truth;
  wrong.heads[1].R_head_rig = test::turned(truth, 60, 60, 4).heads[1].R_head_rig;
  for (const Match& match : matches_of(wrong, 700, {}, 2)) {
    if (match.a == 0 && match.b == 1) matches.push_back(match);
  }
  const auto deceived = find_arrangement(shapes_of(truth), matches, 0);
  ASSERT_TRUE(deceived) << deceived.error().text();
  EXPECT_GT(test::rotation_error(truth, with_rotations(truth, *deceived)).max_deg, 20);
  const std::vector<geometry::Head> heads = geometry::make_heads(truth).value();
  const Trust trust = [&](std::size_t a, std::size_t b, const Eigen::Matrix3d& R_b_a, const SharedLens&) {
    const Eigen::Matrix3d R_true = heads[b].R_head_rig() * heads[a].R_head_rig().transpose();
    return (R_b_a - R_true).norm() < 0.2 ? 0.9 : 0.0;
  };
  const auto found = find_arrangement(shapes_of(truth), matches, 0, {{}, trust});
  ASSERT_TRUE(found) << found.error().text();
  EXPECT_LT(test::rotation_error(truth, with_rotations(truth, *found)).max_deg, 0.2);
  const auto none =
      find_arrangement(shapes_of(truth), matches, 0, {{}, [](auto, auto, const auto&, const auto&) { return 0.0; }});
  ASSERT_FALSE(none);
  EXPECT_NE(none.error().message.find("show different things"), std::string::npos) << none.error().message;
}

TEST(Arrangement, FewPointsInANarrowOverlap_TheFocalLengthThatTheCameraStatesHelps) {
  Calibration truth = test::ring(2, 640, 480);
  for (std::size_t h = 0; h < 2; ++h) {
    truth.heads[h] = test::plain_head("cam" + std::to_string(h), 640, 480, 36.0 * static_cast<double>(h), 42);
  }
  const double focal = 320 / std::tan(21 * kRadiansPerDegree);
  std::vector<Shape> shapes = shapes_of(truth);
  double alone = 0, helped = 0;
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    const std::vector<Match> matches = matches_of(truth, 8000, {1.5, 0}, seed);
    const auto off = [&](std::optional<double> stated) {
      for (Shape& shape : shapes) shape.focal_px = stated;
      const auto found = find_arrangement(shapes, matches, 0);
      return found ? std::abs(std::log(found->lens.model.focal * shapes[0].unit() / focal)) : 1.0;
    };
    alone = std::max(alone, off(std::nullopt));
    helped = std::max(helped, off(1.04 * focal));
  }
  EXPECT_LT(helped, 0.06) << "4 % of it is what was stated wrongly";
  EXPECT_GT(alone, 1.5 * helped);
}

TEST(Arrangement, AnyNumberOfThreads_SameResult) {
  const Calibration truth = test::six_fisheyes(600, 150);
  const std::vector<Match> matches = matches_of(truth, 300, {0.5, 0.3});
  const auto one = find_arrangement(shapes_of(truth), matches, 1),
             four = find_arrangement(shapes_of(truth), matches, 4);
  ASSERT_TRUE(one && four);
  EXPECT_EQ(one->lens.model, four->lens.model);
  for (std::size_t h = 0; h < 6; ++h) EXPECT_EQ(*one->R_head_rig[h], *four->R_head_rig[h]);
}

TEST(Arrangement, NothingInCommon_IsRefused) {
  const Calibration truth = test::six_fisheyes(600, 150);
  const auto none = find_arrangement(shapes_of(truth), {}, 0);
  ASSERT_FALSE(none);
  EXPECT_EQ(none.error().code, Errc::kNoCoverage);
  const auto wrong = find_arrangement(shapes_of(truth), matches_of(truth, 300, {0, 1}), 0);
  ASSERT_FALSE(wrong);
  EXPECT_EQ(wrong.error().code, Errc::kNoCoverage);
}

}  // namespace
}  // namespace nodal::autocalibration
