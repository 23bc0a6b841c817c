// Rays far from every seam get their weights by a bound of the scores' slopes, others by the slopes themselves. Both
// must give the same.
#include <gtest/gtest.h>

#include <cmath>

#include "rigs.h"
#include "stitch/table/head_weight.h"
#include "stitch/table/ray_sampler.h"
#include "tests/support/layouts.h"

namespace nodal::table {
namespace {

/// px; of the regions from the edges of the pictures
constexpr double kInset = 3;

Calibration inset(Calibration rig) {
  for (HeadCalibration& head : rig.heads) {
    head.region = {kInset, kInset, head.width - kInset, head.height - kInset, head.region.circle, {}};
  }
  return rig;
}

/// Heads with masks have no bound, so every ray goes the exact way. This mask hides nothing of an inset region, and is
/// too far from it to reduce a weight.
Calibration exact(Calibration rig) {
  for (HeadCalibration& head : rig.heads) head.region.masks.push_back({{0, 0}, {0.5, 0}, {0, 0.5}});
  return rig;
}

struct Compared {
  int samples = 0;
  int whole = 0;  ///< samples of one head where several see the ray
};

/// Compares every sample of a layout.
Compared compare(const Calibration& given, const std::string& layout_name, int width, TableOptions options) {
  const auto layout = test::layout_of(layout_name, width);
  const Calibration rig = inset(given);
  const std::vector<PixelFormat> formats(rig.heads.size(), PixelFormat::kRgb24);
  const auto fast = RaySampler::make(rig, *layout, PixelFormat::kRgb24, formats, options);
  const auto slow = RaySampler::make(exact(rig), *layout, PixelFormat::kRgb24, formats, options);
  options.transition = Transition::kFeather;
  const auto all = RaySampler::make(rig, *layout, PixelFormat::kRgb24, formats, options);
  Compared compared;
  if (!fast || !slow || !all) {
    ADD_FAILURE() << layout_name << (fast ? "" : fast.error().text()) << (slow ? "" : slow.error().text());
    return compared;
  }
  RowSampler fast_rows(*fast), slow_rows(*slow), all_rows(*all);
  for (int y = 0; y < layout->height(); ++y) {
    fast_rows.sample(0, y);
    slow_rows.sample(0, y);
    all_rows.sample(0, y);
    for (int x = 0; x < layout->width(); ++x) {
      const std::span<const RaySample> a = fast_rows.at(x), b = slow_rows.at(x);
      if (a.size() != b.size()) {
        ADD_FAILURE() << layout_name << " " << x << "," << y << ": " << a.size() << " heads, not " << b.size();
        return compared;
      }
      compared.samples += b.empty() ? 0 : 1;
      compared.whole += b.size() == 1 && all_rows.at(x).size() > 1 ? 1 : 0;
      for (std::size_t k = 0; k < a.size(); ++k) {
        EXPECT_EQ(a[k].head, b[k].head);
        EXPECT_EQ(a[k].x, b[k].x);
        EXPECT_EQ(a[k].y, b[k].y);
        // The mask changes depths by rounding only, 1e-16, which differences over 1e-7 rad make 1e-9.
        EXPECT_NEAR(a[k].weight, b[k].weight, 1e-7) << layout_name << " " << x << "," << y;
      }
    }
  }
  return compared;
}

TEST(ClearOfSeams, EveryLensModelAndLayout_WeightsAreThoseOfTheSlopes) {
  // Six heads of each model that cover the sphere.
  const auto rig_of = [](const LensModel& lens, bool circle) {
    Calibration rig = test::cube_rig(64);
    for (HeadCalibration& head : rig.heads) {
      head.lens = lens;
      if (circle) head.region.circle = {head.center_x + 1, head.center_y, 31};
    }
    return rig;
  };
  const std::vector<Calibration> rigs{test::cube_rig(64),
                                      rig_of(TsaiLens{24, 1e-5, 0}, true),
                                      rig_of(RectilinearLens{{21, 0, -0.4}}, false),
                                      rig_of(EquidistantLens{{21, 0, -0.3}}, true),
                                      rig_of(EquidistantLens{{24}}, false),
                                      rig_of(KannalaBrandtLens{24, {0.02, -0.01, 0, 0}}, true)};
  std::vector<std::string> layouts{"cube:pad=3", "equiangular_cube:pad=2", "central_cylinder:fov=140"};
  for (const geometry::LayoutKind& kind : geometry::layout_kinds()) layouts.emplace_back(kind.name);
  Compared sum;
  for (std::size_t r = 0; r < rigs.size(); ++r) {
    for (const std::string& layout : layouts) {
      SCOPED_TRACE(testing::Message() << "rig " << r);
      TableOptions options;
      options.transition = r % 2 == 0 ? Transition::kSeam : Transition::kTwoBand;
      options.least_weight = 0;
      const Compared one = compare(rigs[r], layout, 72, options);
      sum.samples += one.samples;
      sum.whole += one.whole;
      if (HasFailure()) return;
    }
  }
  EXPECT_GT(sum.whole, sum.samples / 10) << "the test needs rays that only a seam gives to one head";
}

TEST(ClearOfSeams, AnyRigAndSeamWidth_WeightsAreThoseOfTheSlopes) {
  for (unsigned seed = 0; seed < 60; ++seed) {
    std::mt19937 random(seed);
    Calibration rig = test::random_rig(random);
    TableOptions options;
    options.transition = Transition::kSeam;
    options.least_weight = 0;
    options.seam_width_deg = std::array{0.0, 0.5, 2.0, 10.0}[seed % 4];
    SCOPED_TRACE(testing::Message() << "seed " << seed);
    compare(rig, "equirectangular", 128, options);
    if (HasFailure()) return;
  }
}

TEST(ClearOfSeams, ALargePicture_WeightsAreThoseOfTheSlopes) {
  Calibration rig = test::cube_rig(2000);
  rig.heads[1].lens = KannalaBrandtLens{700, {-0.01, 0.002, 0, 0}};
  rig.heads[2].lens = EquidistantLens{{600, 0, -12}};
  TableOptions options;
  options.transition = Transition::kSeam;
  options.least_weight = 0;
  compare(rig, "equirectangular", 1000, options);
}

TEST(SteepestScore, OfAHead_IsALimitOfItsSlopesAndOfTheirSize) {
  const Calibration rig = test::turned_fisheyes({0});
  const auto layout = test::layout_of("equirectangular", 64);
  TableOptions options;
  options.transition = Transition::kSeam;
  const auto sampler =
      RaySampler::make(rig, *layout, PixelFormat::kGrey8, std::vector(1, PixelFormat::kGrey8), options).value();
  const auto score = [&](double angle, double turn) -> std::optional<double> {
    const auto seen = sampler.sight(
        0, geometry::Ray::towards(std::sin(angle) * std::cos(turn), std::sin(angle) * std::sin(turn), std::cos(angle)));
    if (!seen || seen->inside < 0) return std::nullopt;
    return score_of(*seen, sampler.optics()[0].depth_per_px);
  };
  constexpr double kStep = 1e-5;
  double steepest = 0;
  for (double angle = 0.001; angle < 1.1; angle += 0.001) {
    for (const double turn : {0.0, 1.0, 2.5, 4.0}) {
      const auto here = score(angle, turn), along = score(angle + kStep, turn);
      if (here && along) steepest = std::max(steepest, std::abs(*along - *here) / kStep);
    }
  }
  ASSERT_GT(steepest, 0);
  EXPECT_GE(sampler.steepest(0), steepest);
  EXPECT_LE(sampler.steepest(0), 2 * steepest);
}

}  // namespace
}  // namespace nodal::table
