#include "stitch/registration/pyramid.h"

#include <gtest/gtest.h>

#include <cmath>

#include "stitch/geometry/head.h"
#include "tests/support/rendered_rig.h"
#include "tests/support/rigs.h"

namespace nodal::registration {
namespace {

Plane plane_of(int width, int height, double (*f)(double, double)) {
  Plane plane{width, height, {}};
  for (int j = 0; j < height; ++j) {
    for (int i = 0; i < width; ++i) plane.values.push_back(static_cast<float>(f(i + 0.5, j + 0.5)));
  }
  return plane;
}

TEST(Halved, ALinearPicture_StaysLinearInFullSizePixels) {
  const Plane half = halved(plane_of(40, 30, [](double x, double y) { return 3 * x - 2 * y; }));
  ASSERT_EQ(half.width, 20);
  ASSERT_EQ(half.height, 15);
  for (int j = 3; j < 12; ++j) {
    for (int i = 3; i < 17; ++i) {
      // A half-size pixel's centre is at twice its coordinates.
      const auto k = static_cast<std::size_t>(j * 20 + i);
      EXPECT_NEAR(half.values[k], 3 * 2 * (i + 0.5) - 2 * 2 * (j + 0.5), 1e-4);
    }
  }
}

TEST(Blurred, AParabola_RisesByTheVariance) {
  // The mean of x^2 under a Gaussian is x^2 + sigma^2.
  const Plane blur = blurred(plane_of(60, 20, [](double x, double) { return (x - 30) * (x - 30); }), 2.0);
  EXPECT_NEAR(blur.values[10 * 60 + 30] - 0.25, 4.0, 0.08);
}

// The spread of a single bright pixel, in the head's own angles, along and across the radius.
struct Spread {
  double along_rad = 0, across_rad = 0;
};
Spread spread_of(const HeadCalibration& calibration, int x, int y, double sigma) {
  const geometry::Head head = *geometry::Head::make(calibration);
  Plane plane{calibration.width, calibration.height, {}};
  plane.values.assign(static_cast<std::size_t>(plane.width * plane.height), 0.0F);
  plane.values[static_cast<std::size_t>(y * plane.width + x)] = 1;
  const Plane out = blurred_in_angle(plane, 0, *HeadState::from(calibration), sigma);
  const Eigen::Vector3d middle = head.unproject({x + 0.5, y + 0.5})->direction();
  const Eigen::Vector3d axis = head.axis().direction();
  const Eigen::Vector3d along = (axis - middle * middle.dot(axis)).normalized(), across = middle.cross(along);
  Spread spread;
  double total = 0;
  for (int j = 0; j < plane.height; ++j) {
    for (int i = 0; i < plane.width; ++i) {
      const double value = static_cast<double>(out.values[static_cast<std::size_t>(j * plane.width + i)]);
      if (value == 0) continue;
      const Eigen::Vector3d ray = head.unproject({i + 0.5, j + 0.5})->direction();
      total += value;
      spread.along_rad += value * std::pow(std::asin(ray.dot(along)), 2);
      spread.across_rad += value * std::pow(std::asin(ray.dot(across)), 2);
    }
  }
  return {std::sqrt(spread.along_rad / total), std::sqrt(spread.across_rad / total)};
}

TEST(BlurredInAngle, FarFromTheAxisOfAStretchingLens_TheSpreadInAngleIsTheSameBothWays) {
  HeadCalibration head = test::plain_head("cam0", 720, 480);
  head.lens = TsaiLens{490, 2.29e-6, 1.65e-11};
  head.aspect = 1.083;
  const double sigma = 2.0 / 440;
  // The blur of the pixel and of the kernel's interpolation: included in the count but not in the picture, px per side.
  const double counted = level_variance(0);
  for (const auto& [x, y] : {std::pair{360, 240}, {650, 240}, {640, 420}, {360, 440}, {90, 70}}) {
    const Spread spread = spread_of(head, x, y, sigma);
    const auto J = geometry::Head::make(head)
                       ->project_with_jacobian(*geometry::Head::make(head)->unproject({x + 0.5, y + 0.5}))
                       ->J;
    const double px_a_radian2 = J.squaredNorm() / 2;
    EXPECT_NEAR(std::sqrt(spread.along_rad * spread.along_rad + counted / px_a_radian2) / sigma, 1, 0.05);
    EXPECT_NEAR(std::sqrt(spread.across_rad * spread.across_rad + counted / px_a_radian2) / sigma, 1, 0.05);
  }
}

TEST(LightOf, BlackOutsideACircle_IsFilledFromInside) {
  HeadCalibration head = test::plain_head("cam0", 40, 40);
  head.region.circle = Region::Circle{20, 20, 15};
  std::vector<std::uint8_t> bytes(40 * 40);
  for (int j = 0; j < 40; ++j) {
    for (int i = 0; i < 40; ++i) {
      bytes[static_cast<std::size_t>(j * 40 + i)] = std::hypot(i + 0.5 - 20, j + 0.5 - 20) <= 15 ? 90 : 0;
    }
  }
  const ImageView view = packed_image(PixelFormat::kGrey8, 40, 40, static_cast<const std::uint8_t*>(bytes.data()));
  const std::vector<Plane> planes = light_of(view, head, 1);
  for (const float value : planes.front().values) EXPECT_EQ(value, 90.0F);
}

TEST(LightOf, RgbAndGammaCurve_GiveLinearLuminance) {
  HeadCalibration head = test::plain_head("cam0", 2, 1);
  head.response.curve = Response::Curve::kGamma;
  head.response.gamma = 2.0;
  const std::vector<std::uint8_t> bytes{128, 128, 128, 255, 255, 255};
  const ImageView view = packed_image(PixelFormat::kRgb24, 2, 1, bytes.data());
  const std::vector<float> light = light_of(view, head, 1).front().values;
  EXPECT_NEAR(light[0], 255 * std::pow(128 / 255.0, 2), 0.3);
  EXPECT_NEAR(light[1], 255, 1e-3);
}

TEST(LightOf, RgbPictureTurnedUpsideDown_IsReadBackwardsAndNotBeyondItsEnd) {
  HeadCalibration head = test::plain_head("cam0", 2, 1);
  head.response.curve = Response::Curve::kLinear;
  const std::vector<std::uint8_t> bytes{10, 10, 10, 200, 200, 200};
  ImageView view = packed_image(PixelFormat::kRgb24, 2, 1, bytes.data());
  for (PlaneView& plane : view.planes) {  // as when registration tries whether a head hangs upside down
    plane.data += plane.pixel_stride;
    plane.pixel_stride = -plane.pixel_stride;
  }
  const std::vector<float> light = light_of(view, head, 1).front().values;
  EXPECT_NEAR(light[0], 200, 1e-3);
  EXPECT_NEAR(light[1], 10, 1e-3);
}

}  // namespace
}  // namespace nodal::registration
