// Seams against geometry: their position, width, continuity and symmetry on the sphere follow from the rig alone.
#include "stitch/table/seam.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <limits>

#include "protocol/base/angles.h"
#include "rigs.h"
#include "stitch/table/ray_sampler.h"
#include "stitch/table/table_compiler.h"

namespace nodal::table {
namespace {

using Eigen::Vector3d;
using test::cube_rig;
using test::head_at;

/// Any rays, one per pixel.
class Rays final : public geometry::RaymapLayout {
 public:
  explicit Rays(std::vector<Vector3d> rays) : RaymapLayout(static_cast<int>(rays.size()), 1), rays_(std::move(rays)) {}
  std::string_view name() const override { return "rays"; }
  bool scattered() const override { return true; }
  std::optional<geometry::Ray> ray(double x, double) const override {
    return geometry::Ray::towards(rays_[static_cast<std::size_t>(x)]);
  }
  double solid_angle(int, int) const override { return 0; }
  std::optional<geometry::Pixel> pixel(const geometry::Ray&) const override { return std::nullopt; }

 private:
  std::vector<Vector3d> rays_;
};

TableOptions seam_of(double degrees) {
  TableOptions options;
  options.transition = Transition::kSeam;
  options.seam_width_deg = degrees;
  options.least_weight = 0;
  return options;
}

/// Weights by ray, then head.
std::vector<std::vector<double>> weights_of(const Calibration& rig, const std::vector<Vector3d>& rays,
                                            const TableOptions& options) {
  const Rays layout(rays);
  const std::vector<PixelFormat> formats(rig.heads.size(), PixelFormat::kGrey8);
  const RaySampler sampler = RaySampler::make(rig, layout, PixelFormat::kGrey8, formats, options).value();
  RowSampler row(sampler);
  row.sample(0, 0);
  std::vector<std::vector<double>> weights(rays.size(), std::vector<double>(rig.heads.size(), 0.0));
  for (std::size_t k = 0; k < rays.size(); ++k) {
    for (const RaySample& s : row.at(static_cast<int>(k))) weights[k][s.head] = s.weight;
  }
  return weights;
}

/// Two fisheyes of 220 degrees, back to back: by symmetry the seam is the great circle z = 0.
Calibration seam_heads() {
  Calibration rig;
  rig.name = "two";
  for (const double yaw : {0.0, 180.0}) {
    HeadCalibration head =
        head_at("h" + std::to_string(rig.heads.size()), 800, 800, EquidistantLens{{200}}, {yaw, 0, 0});
    head.max_angle = 110 * kRadiansPerDegree;
    head.region.circle = {400, 400, 200 * head.max_angle};
    rig.heads.push_back(head);
  }
  return rig;
}

std::vector<Vector3d> sphere(int count) {
  std::vector<Vector3d> rays;
  for (int k = 0; k < count; ++k) {
    const double y = 1 - (2.0 * k + 1) / count;
    const double turn = k * 2.399963229728653;  // the golden angle
    rays.emplace_back(std::sqrt(1 - y * y) * std::cos(turn), y, std::sqrt(1 - y * y) * std::sin(turn));
  }
  return rays;
}

double share(const std::array<SeamCandidate, 2>& two) { return two[1].weight / (two[0].weight + two[1].weight); }

TEST(Seam, ScoresWithOppositeSlopes_MakeALinearRampOfTheWidthAskedFor) {
  // Scores 1 +- t at distance t from the seam, slopes +-1: the relative difference is exactly t.
  for (const double t : {0.0, 0.001, 0.004, 0.0049, 0.0051, 0.2}) {
    std::array<SeamCandidate, 2> two{SeamCandidate{1 + t, {1, 0}}, SeamCandidate{1 - t, {-1, 0}}};
    apply_seam(two, 0.01);
    EXPECT_EQ(two[0].weight, 1);
    EXPECT_NEAR(share(two), std::max(0.0, (1 - t / 0.005) / 2), 1e-12) << t;
  }
}

TEST(Seam, OfNoWidth_OneHeadTakesAllAndEqualScoresShare) {
  std::array<SeamCandidate, 3> three{SeamCandidate{0.5, {1, 0}}, SeamCandidate{0.5, {-1, 0}},
                                     SeamCandidate{0.499, {0, 1}}};
  apply_seam(three, 0);
  EXPECT_EQ(three[0].weight, 1);
  EXPECT_EQ(three[1].weight, 1);
  EXPECT_EQ(three[2].weight, 0);
}

TEST(Seam, AtTheEdgeOfARegion_NoWidthGivesAHeadWeight) {
  std::array<SeamCandidate, 2> two{SeamCandidate{0.9, {1, 0}}, SeamCandidate{1e-9, {0, 2}}};
  apply_seam(two, 3.14);
  EXPECT_LT(two[1].weight, 2e-9);
}

TEST(Seam, HeadsThatAreTheSameEverywhere_ShareAndNeverDivideByNothing) {
  std::array<SeamCandidate, 2> same{SeamCandidate{0.9, {0, 0}}, SeamCandidate{0.9, {0, 0}}};
  apply_seam(same, 0.01);
  EXPECT_EQ(share(same), 0.5);
  std::array<SeamCandidate, 2> level{SeamCandidate{0.9, {0, 0}}, SeamCandidate{0.8, {0, 0}}};  // no seam nearby
  apply_seam(level, 0.01);
  EXPECT_EQ(share(level), 0);
}

TEST(Seam, OfTwoFisheyesBackToBack_IsTheGreatCircleBetweenThemAndAsWideAsItSays) {
  const Calibration rig = seam_heads();
  for (const double width : {0.2, 1.0, 3.0, 8.0}) {
    for (const double turn : {0.0, 0.7, 2.9}) {
      std::vector<Vector3d> rays;
      std::vector<double> at;  // degrees from the great circle, towards head 0
      for (int k = -600; k <= 600; ++k) {
        at.push_back(k * width / 600);
        const double a = at.back() * kRadiansPerDegree;
        rays.emplace_back(std::cos(a) * std::cos(turn), std::cos(a) * std::sin(turn), std::sin(a));
      }
      const auto weights = weights_of(rig, rays, seam_of(width));
      double first = 0, last = 0;  // first and last place that both heads show
      double off = 0;              // largest difference from a linear ramp
      for (std::size_t k = 0; k < rays.size(); ++k) {
        EXPECT_NEAR(weights[k][0] + weights[k][1], 1, 1e-12);
        off = std::max(off, std::abs(weights[k][0] - std::clamp(0.5 + at[k] / width, 0.0, 1.0)));
        const bool both = weights[k][0] > 0 && weights[k][1] > 0;
        if (both && first == 0) first = at[k];
        if (both) last = at[k];
      }
      // The distance is a first-order estimate, so errors grow with the square of width / overlap (40 degrees).
      const double part = width / 40;
      EXPECT_LT(off, 0.001 + 2 * part * part);
      EXPECT_NEAR(last - first, width, width * (0.005 + 4 * part * part)) << "turned by " << turn;
      EXPECT_NEAR(last + first, 0, 0.001 * width);
    }
  }
}

TEST(Seam, OfAnyWidth_WeightsSumToOneAndNoHeadHasWeightAtItsEdge) {
  const Calibration rig = cube_rig(300);
  const auto rays = sphere(4000);
  for (const double width : {0.0, 0.5, 5.0, 40.0, 180.0}) {
    const auto weights = weights_of(rig, rays, seam_of(width));
    for (std::size_t k = 0; k < rays.size(); ++k) {
      double sum = 0;
      for (std::size_t h = 0; h < 6; ++h) {
        sum += weights[k][h];
        const geometry::Head head = geometry::Head::make(rig.heads[h]).value();
        const auto pixel = head.project(geometry::Ray::towards(rays[k]));
        const double inside = pixel ? head.distance_to_edge(*pixel) : -1;
        if (inside < 0) {
          EXPECT_EQ(weights[k][h], 0);
        }
        // 1 px of the 150 to the centre: a score of 0.011, compared with about 0.5 for heads well inside.
        if (inside < 1) {
          EXPECT_LT(weights[k][h], 0.03) << width;
        }
      }
      EXPECT_NEAR(sum, 1, 1e-12);
    }
  }
}

TEST(Seam, OfACube_IsThePlaneBetweenEachTwoFacesAndTheSameForAllOfThem) {
  // A cube's 24 rotations map the rig to itself: head h weighs a ray as head g(h) weighs the rotated ray.
  const Calibration rig = cube_rig(200);
  const auto rays = sphere(3000);
  const auto before = weights_of(rig, rays, seam_of(4));
  for (const geometry::YawPitchRoll pose :
       {geometry::YawPitchRoll{90, 0, 0}, geometry::YawPitchRoll{0, 90, 0}, geometry::YawPitchRoll{0, 0, 90}}) {
    const Eigen::Matrix3d R = geometry::to_R_head_rig(pose);
    std::vector<Vector3d> turned;
    for (const Vector3d& ray : rays) turned.push_back(R * ray);
    const auto after = weights_of(rig, turned, seam_of(4));
    for (std::size_t h = 0; h < 6; ++h) {
      const Vector3d axis = R * geometry::matrix_of(rig.heads[h].R_head_rig).row(2).transpose();
      std::size_t g = 0;
      while (geometry::matrix_of(rig.heads[g].R_head_rig).row(2).dot(axis) < 0.9) ++g;
      for (std::size_t k = 0; k < rays.size(); ++k) EXPECT_NEAR(before[k][h], after[k][g], 1e-5);
    }
  }
  // More than half a ramp from every plane |x| = |y|, the face that the ray meets has the whole weight.
  for (std::size_t k = 0; k < rays.size(); ++k) {
    const Vector3d d = rays[k].cwiseAbs();
    Eigen::Index face = 0;
    const double most = d.maxCoeff(&face);
    const double next = std::max(d[(face + 1) % 3], d[(face + 2) % 3]);
    const double off = std::asin((most - next) / std::sqrt(2.0)) / kRadiansPerDegree;  // from the nearest plane
    const double largest = *std::ranges::max_element(before[k]);
    if (off > 2.2) {
      EXPECT_NEAR(largest, 1, 1e-12) << rays[k].transpose();
    }
    if (off < 1.8) {
      EXPECT_LT(largest, 0.99) << rays[k].transpose();
    }
  }
}

TEST(Seam, AlongAnyPath_WeightsAreContinuous) {
  // Great circles in every direction over the corners of three heads. A ramp of 4 degrees rises by 1/4 per degree;
  // where three heads meet, and where a region's nearest edge changes, it may be a few times as steep, but never jumps.
  const Calibration rig = cube_rig(300);
  constexpr double kStepDeg = 0.02;
  for (const Vector3d& start : sphere(60)) {
    std::vector<Vector3d> path;
    const Vector3d aside = start.unitOrthogonal();
    for (int k = 0; k * kStepDeg < 360; ++k) {
      const double a = k * kStepDeg * kRadiansPerDegree;
      path.push_back(std::cos(a) * start + std::sin(a) * aside);
    }
    const auto weights = weights_of(rig, path, seam_of(4));
    for (std::size_t k = 1; k < path.size(); ++k) {
      for (std::size_t h = 0; h < 6; ++h) {
        EXPECT_LT(std::abs(weights[k][h] - weights[k - 1][h]), 4 * kStepDeg / 4) << path[k].transpose();
      }
    }
  }
}

TEST(Seam, RoundAMask_TheOtherHeadTakesOverContinuouslyAndNothingElseMoves) {
  const Calibration rig = seam_heads();
  Calibration masked = rig;
  // For head 0, from 80 to 86 degrees to the right of its axis: head 1 sees all of it.
  const double near = 400 + 200 * 80 * kRadiansPerDegree, far = 400 + 200 * 86 * kRadiansPerDegree;
  masked.heads[0].region.masks = {{{near, 380}, {far, 380}, {far, 420}, {near, 420}}};
  std::vector<Vector3d> along;
  for (int k = 0; k <= 20000; ++k) {
    const double a = (60 + k * 0.002) * kRadiansPerDegree;
    along.emplace_back(std::sin(a), 0, std::cos(a));
  }
  for (const TableOptions& options : {seam_of(0.5), seam_of(4), TableOptions{.transition = Transition::kFeather}}) {
    const auto before = weights_of(rig, along, options);
    const auto after = weights_of(masked, along, options);
    for (std::size_t k = 0; k < along.size(); ++k) {
      const double angle = 60 + static_cast<double>(k) * 0.002;
      EXPECT_NEAR(after[k][0] + after[k][1], 1, 1e-12);
      if (angle > 80.001 && angle < 85.999) {
        EXPECT_EQ(after[k][0], 0) << angle;
      }
      if (k > 0) {
        EXPECT_LT(std::abs(after[k][0] - after[k - 1][0]), 0.02) << angle;
      }
      const bool far_off = angle < 66 && options.transition == Transition::kSeam;
      if (far_off) {
        EXPECT_NEAR(after[k][0], before[k][0], 1e-12) << angle;
      }
    }
  }
}

TEST(Seam, WidthThatCannotBe_IsRefusedByNumberAndRange) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const double endless = std::numeric_limits<double>::infinity();
  for (const double width : {-1.0, -1e-300, 180.001, 1e300, endless, -endless, nan}) {
    const auto table = compile_blend_table(cube_rig(24), {"equirectangular", 32, 16, PixelFormat::kGrey8},
                                           std::vector(6, PixelFormat::kGrey8), seam_of(width));
    ASSERT_FALSE(table) << width;
    EXPECT_EQ(table.error().code, Errc::kBadValue);
    EXPECT_NE(table.error().message.find("0 to 180 degrees"), std::string::npos) << table.error().message;
  }
  TableOptions options;
  for (const double feather : {0.0, -0.5, 1.01, nan}) {
    options.feather = feather;
    EXPECT_FALSE(compile_blend_table(cube_rig(24), {"equirectangular", 32, 16, PixelFormat::kGrey8},
                                     std::vector(6, PixelFormat::kGrey8), options));
  }
}

}  // namespace
}  // namespace nodal::table
