// Lenses whose middle no match shows: families, what is claimed, derivatives.
#include "stitch/autocalibration/lens_choice.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <random>

#include "protocol/base/angles.h"

namespace nodal::autocalibration {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

struct Kind {
  Family family;
  std::function<double(double)> radius;  ///< at an angle, with focal length 1
};

std::vector<Kind> kinds() {
  return {{Family::kEquidistant, [](double a) { return a; }},
          {Family::kEquisolid, [](double a) { return 2 * std::sin(a / 2); }},
          {Family::kStereographic, [](double a) { return 2 * std::tan(a / 2); }},
          {Family::kOrthographic, [](double a) { return std::sin(a); }},
          {Family::kRectilinear, [](double a) { return std::tan(a); }}};
}

TEST(LensFamily, EachOne_IsWithinThreeThousandthsOfItsFormula) {
  for (const Kind& kind : kinds()) {
    const Result<LensRays> lens = LensRays::make({family_lens(kind.family)});
    ASSERT_TRUE(lens) << family_name(kind.family);
    const double end = (kind.family == Family::kRectilinear ? 56 : kind.family == Family::kOrthographic ? 78 : 115);
    for (double deg = 5; deg <= end; deg += 5) {
      const double a = deg * kRadiansPerDegree;
      ASSERT_TRUE(lens->radius(a)) << family_name(kind.family) << " " << deg;
      EXPECT_NEAR(*lens->radius(a) / kind.radius(a), 1, 0.003) << family_name(kind.family) << " " << deg;
    }
  }
}

SharedLens odd_lens() {
  SharedLens lens;
  lens.model = {0.6, {-0.03, 0.004, 0.001, 0}};
  lens.aspect = 1.08;
  lens.shift = {0.02, -0.01};
  return lens;
}

SharedLens changed(SharedLens lens, int unknown, double by) {
  if (unknown == kLogFocal) lens.model.focal *= std::exp(by);
  else if (unknown == kLogAspect) lens.aspect *= std::exp(by);
  else if (unknown >= kShift) lens.shift[unknown - kShift] += by;
  else lens.model.k[static_cast<std::size_t>(unknown - kFirstRadial)] += by;
  return lens;
}

TEST(LensRays, ExactlyBehindALensThatSeesSoFar_IsNowhere) {
  const LensRays lens = *LensRays::make({family_lens(Family::kEquidistant)});
  ASSERT_TRUE(lens.at({1e-6, 0, -1}));
  EXPECT_FALSE(lens.at({0, 0, -1}));
  EXPECT_TRUE(lens.at({0, 0, 1}));
}

TEST(LensRays, Slopes_AreThoseOfDifferences) {
  constexpr double kStep = 1e-6;
  const LensRays lens = *LensRays::make(odd_lens());
  for (const Vector2d& at : {Vector2d(0.1, 0.05), Vector2d(-0.7, 0.3), Vector2d(0.5, -0.85)}) {
    const auto slopes = lens.ray_slopes(at);
    ASSERT_TRUE(slopes);
    EXPECT_LT((slopes->ray - *lens.ray(at)).norm(), 1e-12);
    const auto back = lens.point_slopes(slopes->ray);
    ASSERT_TRUE(back);
    EXPECT_LT((back->at - at).norm(), 1e-9);
    for (int k = 0; k < kLensUnknowns; ++k) {
      const LensRays more = *LensRays::make(changed(odd_lens(), k, kStep)),
                     less = *LensRays::make(changed(odd_lens(), k, -kStep));
      EXPECT_LT((slopes->by_lens.col(k) - (*more.ray(at) - *less.ray(at)) / (2 * kStep)).norm(), 1e-6) << k;
      EXPECT_LT((back->by_lens.col(k) - (*more.at(slopes->ray) - *less.at(slopes->ray)) / (2 * kStep)).norm(), 1e-6)
          << k;
    }
    for (const Vector3d& way : {Vector3d(1, 0, 0), Vector3d(0, 1, 0), Vector3d(0, 0, 1)}) {
      const Vector3d step = kStep * way;
      const Vector2d difference = (*lens.at(slopes->ray + step) - *lens.at(slopes->ray - step)) / (2 * kStep);
      EXPECT_LT((back->by_ray * way - difference).norm(), 1e-6);
    }
  }
}

/// Matches of two heads back to back, whose lens has this radius at its angles: 1 at `edge_deg`.
std::vector<UnitMatch> back_to_back(const Kind& kind, double edge_deg, double noise, int count) {
  std::mt19937_64 random(4);
  std::normal_distribution<double> normal(0, noise);
  std::uniform_real_distribution<double> unit(0, 1);
  const double edge = edge_deg * kRadiansPerDegree, focal = 1 / kind.radius(edge);
  std::vector<UnitMatch> matches;
  for (int n = 0; n < count; ++n) {
    const double least = 180 * kRadiansPerDegree - edge, a = least + (edge - least) * unit(random),
                 turn = 2 * 180 * kRadiansPerDegree * unit(random);
    const double opposite = 180 * kRadiansPerDegree - a;
    const auto at = [&](double angle, double sign) {
      const double r = focal * kind.radius(angle), dx = normal(random), dy = normal(random);
      return Vector2d(sign * r * std::cos(turn) + dx, r * std::sin(turn) + dy);
    };
    const Vector2d in_a = at(a, 1), in_b = at(opposite, -1);
    matches.push_back({0, 1, in_a, in_b});
  }
  return matches;
}

TEST(LensChoice, PairsBackToBack_NoRadiusThatCountsAsKnownIsThreePercentOff) {
  for (const double edge : {92.5, 97.0, 100.0, 105.0, 110.0}) {
    for (const Kind& kind : kinds()) {
      if (kind.family == Family::kOrthographic || kind.family == Family::kRectilinear) continue;  // do not see so far
      SharedLens start;
      // Equidistant, and right at 90 degrees: that is what matches of such a pair determine.
      const double right_angle = 90 * kRadiansPerDegree;
      start.model = {kind.radius(right_angle) / kind.radius(edge * kRadiansPerDegree) / right_angle, {}};
      Eigen::Matrix3d back;
      back << -1, 0, 0, 0, 1, 0, 0, 0, -1;
      const BundleRules rules{start, 0, false, {0.05, 0.01}, 0.02, 0, 0};
      const std::vector<UnitMatch> matches = back_to_back(kind, edge, 0.0008, 120);
      const LensChoice choice =
          choose_lens({start, {Eigen::Matrix3d::Identity(), back}}, matches, rules, parallel::Workers(2));
      const LensRays lens = *LensRays::make(choice.fit.state.lens);
      const double focal = 1 / kind.radius(edge * kRadiansPerDegree);
      EXPECT_FALSE(choice.evidence.family.empty());
      for (double deg = 4; deg < edge - 1; deg += 2) {
        const double a = deg * kRadiansPerDegree, truth = focal * kind.radius(a), found = lens.radius(a).value_or(0);
        const bool known = truth > choice.evidence.known_from && truth < choice.evidence.known_to;
        if (known) {
          EXPECT_NEAR(found / truth, 1, 0.03) << family_name(kind.family) << " " << edge << " at " << deg;
        }
        EXPECT_NEAR(found / truth, 1, 0.25) << "a guess, but of a lens that is built";
      }
      EXPECT_GT(choice.evidence.seen_from, 0.4);
      EXPECT_FALSE(choice.evidence.whole() && std::abs(*lens.radius(0.2) / (focal * kind.radius(0.2)) - 1) > 0.03);
    }
  }
}

TEST(LensChoice, PairWithAThinOverlap_CountsAsKnownOnlyWhereItsMatchesAre) {
  for (const double edge : {93.0, 95.0, 97.0}) {
    const Kind kind = kinds().front();
    SharedLens start;
    start.model = {1 / (edge * kRadiansPerDegree), {}};
    Eigen::Matrix3d back;
    back << -1, 0, 0, 0, 1, 0, 0, 0, -1;
    // Near things, seen from two places: both heads see them too far from the axis, by up to 3 degrees.
    std::vector<UnitMatch> matches = back_to_back(kind, edge, 0.0008, 26);
    for (std::size_t n = 0; n < matches.size(); n += 5) {
      const double farther = 1 + 0.006 * static_cast<double>(n % 4);
      matches[n].at_a *= farther;
      matches[n].at_b *= farther;
    }
    const LensChoice choice = choose_lens({start, {Eigen::Matrix3d::Identity(), back}}, matches,
                                          {start, 0, false, {0.05, 0.01}, 0.02, 0, 0}, parallel::Workers(2));
    const LensEvidence& evidence = choice.evidence;
    const double range = evidence.seen_to - evidence.seen_from;
    EXPECT_GT(evidence.seen_from, 0.84);
    EXPECT_GE(evidence.known_from, evidence.seen_from - range - 0.01) << edge;
    EXPECT_LE(evidence.known_to, evidence.seen_to + range / 4 + 0.01) << edge;
    // What nothing shows is a lens that is built, and near the commonest: thin overlaps do not bend it.
    const LensRays lens = *LensRays::make(choice.fit.state.lens);
    EXPECT_NEAR(lens.radius(45 * kRadiansPerDegree).value_or(0), 45 / edge, 0.04 * 45 / edge) << edge;
    EXPECT_NEAR(lens.angle(1).value_or(0) / kRadiansPerDegree, edge, 2) << edge;
  }
}

TEST(LensChoice, EquidistantPairOf200Degrees_IsEquidistantInItsMiddle) {
  const Kind kind = kinds().front();
  SharedLens start;
  start.model = {1 / (98 * kRadiansPerDegree), {}};
  Eigen::Matrix3d back;
  back << -1, 0, 0, 0, 1, 0, 0, 0, -1;
  const LensChoice choice =
      choose_lens({start, {Eigen::Matrix3d::Identity(), back}}, back_to_back(kind, 100, 0.001, 90),
                  {start, 0, false, {0.05, 0.01}, 0.02, 0, 0}, parallel::Workers(2));
  const LensRays lens = *LensRays::make(choice.fit.state.lens);
  for (const double deg : {10.0, 45.0, 80.0, 98.0}) {
    EXPECT_NEAR(*lens.radius(deg * kRadiansPerDegree), deg / 100, 0.03 * deg / 100) << deg;
  }
}

}  // namespace
}  // namespace nodal::autocalibration
