// Lenses from corners of a board that another program found.
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "stitch/calibration/lens/calibrate.h"
#include "stitch/geometry/rotation.h"

namespace nodal::calibration {
namespace {

constexpr double kFocal = 410;  // px per rad: r = f a
constexpr int kWide = 1280, kHigh = 960;
const Eigen::Vector2d kAxis(652, 471);

/// Corners of 9 x 6 squares of 30 mm, as a fisheye with equal angles shows them; `noise` px.
CornerView photographed(const std::string& name, const Eigen::Vector3d& turn, const Eigen::Vector3d& at_mm,
                        double noise, double up) {
  std::mt19937 random(7);
  std::normal_distribution<double> error(0, noise);
  CornerView view{name, {}};
  const Eigen::Matrix3d R = geometry::rotation_about(turn);
  for (int j = 0; j < 7; ++j) {
    for (int i = 0; i < 10; ++i) {
      const Eigen::Vector3d p = R * Eigen::Vector3d(30 * i - 135, 30 * j - 90, 0) + at_mm;
      const double off = std::hypot(p.x(), p.y()), r = kFocal * std::atan2(off, p.z());
      view.corners.push_back(
          {kAxis + r / off * p.head<2>() + Eigen::Vector2d(error(random), error(random)), {30.0 * i, up * 30.0 * j}});
    }
  }
  return view;
}

std::vector<CornerView> four_photographs(double noise, double up) {
  return {photographed("a.jpg", {0.5, 0, 0.1}, {20, 10, 230}, noise, up),
          photographed("b.jpg", {-0.4, 0.3, 0}, {-60, 30, 250}, noise, up),
          photographed("c.jpg", {0, -0.6, 0.2}, {80, -40, 260}, noise, up),
          photographed("d.jpg", {0.2, 0.5, -0.3}, {-30, -50, 220}, noise, up)};
}

TEST(Corners, OfAFisheye_GiveItsLensWhicheverWayTheBoardsYGoes) {
  for (const double up : {1.0, -1.0}) {
    LensOptions options;
    options.kind = LensKind::kKannalaBrandt;
    options.aspect_known = true;
    const auto found = calibrate_on_corners(four_photographs(0.1, up), kWide, kHigh, options);
    ASSERT_TRUE(found) << found.error().text();
    const LensReport& report = found->report;
    EXPECT_NEAR(report.focal.value, kFocal, 1);
    EXPECT_NEAR(report.center_x.value, kAxis.x(), 1);
    EXPECT_NEAR(report.center_y.value, kAxis.y(), 1);
    EXPECT_LT(std::abs(report.focal.value - kFocal), 4 * report.focal.deviation);
    ASSERT_EQ(report.views.size(), 4U);
    EXPECT_EQ(report.views[0].pairs, 70);
    EXPECT_NEAR(report.views[0].rms_px, 0.1 * std::sqrt(2.0), 0.04);
    EXPECT_EQ(found->head.width, kWide);
  }
}

TEST(Corners, ThatCannotBe_AreRefusedWithTheirPhotograph) {
  auto views = four_photographs(0.1, 1);
  std::mt19937 random(3);
  for (PointPair& corner : views[1].corners)
    corner.photo = {static_cast<double>(random() % kWide), static_cast<double>(random() % kHigh)};
  const auto scattered = calibrate_on_corners(views, kWide, kHigh, {});
  ASSERT_FALSE(scattered);
  EXPECT_NE(scattered.error().message.find("b.jpg"), std::string::npos) << scattered.error().message;
  views = four_photographs(0.1, 1);
  views[2].corners.resize(12);
  EXPECT_NE(calibrate_on_corners(views, kWide, kHigh, {}).error().message.find("c.jpg: has 12 corners"),
            std::string::npos);
  views.resize(1);
  EXPECT_EQ(calibrate_on_corners(views, kWide, kHigh, {}).error().code, Errc::kNotDetermined);
}

}  // namespace
}  // namespace nodal::calibration
