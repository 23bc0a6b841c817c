// Point pairs of rigs with known geometry, made by projecting the same rays into the heads.
#include "stitch/registration/pairs.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>

#include "stitch/geometry/head.h"
#include "stitch/geometry/rotation.h"
#include "stitch/registration/pair_start.h"
#include "tests/support/rendered_rig.h"

namespace nodal::registration {
namespace {

// Rays over the whole sphere, for every two heads that see them.
std::vector<PointPair> pairs_of(const Calibration& truth, int rays, double noise_px, std::uint64_t seed) {
  const std::vector<geometry::Head> heads = geometry::make_heads(truth).value();
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  std::vector<PointPair> pairs;
  for (int k = 0; k < rays; ++k) {
    const double x = normal(random), y = normal(random), z = normal(random);
    const geometry::Ray ray = geometry::Ray::towards(x, y, z);
    const auto seen = [&](std::size_t h) -> std::optional<geometry::Pixel> {
      const auto at = heads[h].project(ray);
      if (!at || !heads[h].contains(*at)) return std::nullopt;
      return geometry::Pixel{at->x + noise_px * normal(random), at->y + noise_px * normal(random)};
    };
    for (std::size_t a = 0; a < heads.size(); ++a) {
      for (std::size_t b = a + 1; b < heads.size(); ++b) {
        const auto pa = seen(a), pb = seen(b);
        if (pa && pb) pairs.push_back(k % 2 == 0 ? PointPair{a, *pa, b, *pb} : PointPair{b, *pb, a, *pa});
      }
    }
  }
  return pairs;
}

TEST(Pairs, ExactOnesAndHeadsAnywhere_PlaceThemToRounding) {
  const Calibration truth = test::six_fisheyes(400);
  const Calibration prior = test::turned(truth, 40, 180, 2);
  const Result<PairFit> fit = fit_to_pairs(prior, pairs_of(truth, 80, 0, 1), Free::kRotations);
  ASSERT_TRUE(fit) << fit.error().text();
  EXPECT_LT(test::rotation_error(truth, fit->calibration).max_deg, 1e-7);
  EXPECT_LT(fit->rms_deg, 1e-7);
  EXPECT_EQ(fit->calibration.heads[0].R_head_rig, prior.heads[0].R_head_rig) << "the first head holds the rig";
}

/// Two heads that see the same rays, of which `right` in a thousand belong together.
std::vector<RayPair> ray_pairs(std::size_t a, std::size_t b, std::size_t count, int right, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  const auto any = [&] { return Eigen::Vector3d(normal(random), normal(random), normal(random)).normalized(); };
  std::vector<RayPair> pairs;
  for (std::size_t k = 0; k < count; ++k) {
    const Eigen::Vector3d ray = any();
    pairs.push_back({a, b, ray, static_cast<int>(k % 1000) < right ? ray : any()});
  }
  return pairs;
}

// Every two pairs are a combination: 45 thousand million of them, of which 1500 are tried.
TEST(Pairs, AsManyAsAFileCanHold_TakeATimeThatGrowsWithThem) {
  const std::vector<Eigen::Matrix3d> R(64, Eigen::Matrix3d::Identity());
  const std::vector<RayPair> pairs = ray_pairs(3, 5, 300'000, 900, 1);
  const PairStart start = start_from_pairs(R, pairs);
  EXPECT_EQ(std::ranges::count_if(start.R_head_rig, [](const auto& pose) { return pose.has_value(); }), 2);
  EXPECT_GE(start.agreeing, 269'000);
}

TEST(Pairs, GroupsThatNoPairJoins_AreIslandsEachWithItsFirstHead) {
  const std::vector<Eigen::Matrix3d> R(6, Eigen::Matrix3d::Identity());
  std::vector<RayPair> pairs = ray_pairs(0, 2, 50, 1000, 1);
  for (const auto& [a, b] : {std::pair{1, 4}, std::pair{4, 5}}) {
    const auto more = ray_pairs(static_cast<std::size_t>(a), static_cast<std::size_t>(b), 50, 1000, 2);
    pairs.insert(pairs.end(), more.begin(), more.end());
  }
  std::vector<std::vector<std::size_t>> found;
  for (const PairStart& island : islands_from_pairs(R, pairs)) {
    found.emplace_back();
    for (std::size_t h = 0; h < R.size(); ++h) {
      if (island.R_head_rig[h]) found.back().push_back(h);
    }
    EXPECT_EQ(island.first, found.back().front());
  }
  EXPECT_EQ(found, (std::vector<std::vector<std::size_t>>{{0, 2}, {1, 4, 5}, {3}}));
}

TEST(Pairs, NoiseOfHalfAPixel_ErrorIsWhatTheUncertaintySays) {
  const Calibration truth = test::six_fisheyes(400);
  double squares = 0;
  int heads = 0;
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    const Calibration prior = test::turned(truth, 10, 40, seed);
    const Result<PairFit> fit = fit_to_pairs(prior, pairs_of(truth, 60, 0.5, seed), Free::kRotations);
    ASSERT_TRUE(fit) << fit.error().text();
    const double error = test::rotation_error(truth, fit->calibration).rms_deg;
    EXPECT_LT(error, 0.15);
    for (std::size_t h = 1; h < 6; ++h) {
      squares += std::pow(error / fit->heads[h].sigma_deg, 2);
      ++heads;
    }
  }
  // sigma is for the worst axis and relative to the first head; the error is over all three, relative to the mean.
  EXPECT_GT(std::sqrt(squares / heads), 0.4);
  EXPECT_LT(std::sqrt(squares / heads), 2.0);
}

TEST(Pairs, AFifthOfThemWrong_AreLeftOutAndNothingElse) {
  const Calibration truth = test::six_fisheyes(400);
  std::vector<PointPair> pairs = pairs_of(truth, 100, 0.3, 3);
  std::mt19937_64 random(5);
  std::uniform_real_distribution<double> anywhere(80, 320);
  std::size_t wrong = 0;
  for (std::size_t p = 0; p < pairs.size(); p += 5, ++wrong) pairs[p].pixel_b = {anywhere(random), anywhere(random)};
  const Result<PairFit> fit = fit_to_pairs(test::turned(truth, 20, 60, 4), pairs, Free::kRotations);
  ASSERT_TRUE(fit) << fit.error().text();
  EXPECT_LT(test::rotation_error(truth, fit->calibration).rms_deg, 0.05);
  std::size_t left_out = 0;
  for (std::size_t p = 0; p < pairs.size(); ++p) {
    if (p % 5 == 0) left_out += fit->used[p] ? 0 : 1;
    else EXPECT_TRUE(fit->used[p]) << p;
  }
  EXPECT_GE(left_out, wrong - 2) << "one in a hundred may lie right by chance";
}

TEST(Pairs, FocalsTwoPercentOff_AreFoundWhenAskedFor) {
  const Calibration truth = test::six_fisheyes(400);
  Calibration prior = test::turned(truth, 5, 20, 6);
  for (std::size_t h = 0; h < 6; ++h) {
    std::get<EquidistantLens>(prior.heads[h].lens).coefficients[0] *= h % 2 == 0 ? 1.02 : 0.98;
  }
  const Result<PairFit> fit = fit_to_pairs(prior, pairs_of(truth, 150, 0, 7), Free::kFocals);
  ASSERT_TRUE(fit) << fit.error().text();
  for (std::size_t h = 0; h < 6; ++h) {
    const double found = std::get<EquidistantLens>(fit->calibration.heads[h].lens).coefficients[0];
    EXPECT_NEAR(found / std::get<EquidistantLens>(truth.heads[h].lens).coefficients[0], 1, 2e-4);
  }
  EXPECT_LT(test::rotation_error(truth, fit->calibration).rms_deg, 0.01);
}

// An estimate from noisy points is drawn towards longer focal lengths if the errors are angles: a longer lens makes all
// angles smaller. Three heads side by side, whose pairs alone determine the focal lengths.
TEST(Pairs, FocalsOfNoisyPairsInThinOverlaps_AreOnAverageTheTrueOnes) {
  Calibration truth = test::six_fisheyes(400);
  truth.heads.resize(3);
  for (std::size_t h = 0; h < 3; ++h) {
    truth.heads[h].lens = RectilinearLens{{300}};
    truth.heads[h].max_angle = 1.2;
    truth.heads[h].region.circle.reset();
    const Eigen::Matrix3d R = geometry::rotation_about(Eigen::Vector3d(0, -0.95 * (static_cast<double>(h) - 1), 0));
    truth.heads[h].R_head_rig = geometry::rows_of(R);
  }
  double sum = 0, squares = 0;
  constexpr int kTrials = 60;
  for (std::uint64_t seed = 1; seed <= kTrials; ++seed) {
    const Result<PairFit> fit = fit_to_pairs(truth, pairs_of(truth, 1200, 2, seed), Free::kFocals);
    ASSERT_TRUE(fit) << fit.error().text();
    double mean = 0;
    for (std::size_t h = 0; h < 3; ++h) mean += fit->heads[h].focal_change_percent / 3;
    sum += mean / kTrials;
    squares += mean * mean / kTrials;
  }
  const double sigma = std::sqrt((squares - sum * sum) / kTrials);
  EXPECT_LT(std::abs(sum), 3 * sigma);
}

TEST(Pairs, AHeadThatNoPairJoins_IsNamedAndKept) {
  const Calibration truth = test::six_fisheyes(400);
  std::vector<PointPair> pairs = pairs_of(truth, 60, 0.2, 8);
  std::erase_if(pairs, [](const PointPair& pair) { return pair.head_a == 3 || pair.head_b == 3; });
  const Calibration prior = test::turned(truth, 10, 20, 9);
  const Result<PairFit> fit = fit_to_pairs(prior, pairs, Free::kRotations);
  ASSERT_TRUE(fit) << fit.error().text();
  EXPECT_FALSE(fit->heads[3].placed);
  EXPECT_EQ(fit->calibration.heads[3].R_head_rig, prior.heads[3].R_head_rig);
  ASSERT_EQ(fit->warnings.size(), 1u);
  EXPECT_NE(fit->warnings[0].find("'cam3'"), std::string::npos);
}

TEST(Pairs, PairsThatSayNothingOrContradictThemselves_AreRefused) {
  const Calibration truth = test::six_fisheyes(400);
  EXPECT_EQ(fit_to_pairs(truth, {}, Free::kRotations).error().code, Errc::kNoCoverage);
  const std::vector<PointPair> one{pairs_of(truth, 60, 0, 1).front()};
  EXPECT_EQ(fit_to_pairs(truth, one, Free::kRotations).error().code, Errc::kNoCoverage);
  EXPECT_EQ(fit_to_pairs(truth, {{0, {200, 200}, 9, {200, 200}}}, Free::kRotations).error().code, Errc::kBadValue);
  std::vector<PointPair> outside{{0, {-900, 200}, 1, {200, 200}}};
  Calibration capped = truth;
  for (HeadCalibration& head : capped.heads) head.max_angle = 1.6;
  const auto beyond = fit_to_pairs(capped, outside, Free::kRotations);
  ASSERT_FALSE(beyond);
  EXPECT_NE(beyond.error().message.find("head 'cam0'"), std::string::npos);
  std::mt19937_64 random(5);
  std::uniform_real_distribution<double> anywhere(80, 320);
  std::vector<PointPair> nonsense;
  for (int k = 0; k < 200; ++k) {
    nonsense.push_back({static_cast<std::size_t>(k % 6),
                        {anywhere(random), anywhere(random)},
                        static_cast<std::size_t>((k + 1 + k % 3) % 6),
                        {anywhere(random), anywhere(random)}});
  }
  const auto contradiction = fit_to_pairs(truth, nonsense, Free::kRotations);
  ASSERT_FALSE(contradiction);
  EXPECT_EQ(contradiction.error().code, Errc::kHeadMismatch) << contradiction.error().text();
}

}  // namespace
}  // namespace nodal::registration
