// Heads against pictures of a known sphere, rendered by a program that shares no code with ours.
#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <algorithm>
#include <cmath>

#include "files.h"
#include "stitch/geometry/head.h"
#include "stitch/geometry/raymap/layout.h"
#include "stitch/media/image_file.h"
#include "tests/data/truth_rig.h"

namespace nodal::test_data {
namespace {

using geometry::Head;
using geometry::Pixel;

/// Bilinear, wrapping around the back of the sphere; channel c at continuous coordinates.
double sample(const ImageView& image, double x, double y, std::size_t c) {
  const PlaneView& plane = image.planes[c];
  const double u = x - 0.5, v = std::clamp(y - 0.5, 0.0, plane.height - 1.001);
  const int i = static_cast<int>(std::floor(u)), j = static_cast<int>(v);
  const auto at = [&](int column, int row) {
    column = (column % plane.width + plane.width) % plane.width;
    return static_cast<double>(plane.data[row * plane.row_stride + column * plane.pixel_stride]);
  };
  const double a = u - std::floor(u), b = v - j;
  return (1 - b) * ((1 - a) * at(i, j) + a * at(i + 1, j)) + b * ((1 - a) * at(i, j + 1) + a * at(i + 1, j + 1));
}

/// The difference between a head's picture and the sphere seen through it: a shift (px), a factor, and the rest.
struct Difference {
  Eigen::Vector2d shift;
  double factor;
  double psnr;
};

/// Least squares over a grid of pixels: got = L S(x, y) + shift . grad(L S) + (factor - 1) L S, with L the head's
/// gain and vignetting and S the sphere where the pixel's ray meets it.
Difference compare(const Head& head, const ImageView& picture, const ImageView& sphere,
                   const geometry::RaymapLayout& layout) {
  Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
  Eigen::Vector3d right = Eigen::Vector3d::Zero();
  double squares = 0, count = 0;
  const auto seen = [&](double x, double y, std::size_t c) {
    const Pixel projected = *layout.pixel(*head.unproject({x, y}));
    return head.calibration().gain[c] * head.vignetting({x, y}) * sample(sphere, projected.x, projected.y, c);
  };
  for (int j = 2; j < head.height() - 2; j += 3) {
    for (int i = 2; i < head.width() - 2; i += 3) {
      for (std::size_t c = 0; c < 3; ++c) {
        const double got =
            picture.planes[c].data[j * picture.planes[c].row_stride + i * picture.planes[c].pixel_stride];
        if (got > 250) continue;  // clipped
        const double x = i + 0.5, y = j + 0.5, here = seen(x, y, c);
        const Eigen::Vector3d slopes(seen(x + 0.5, y, c) - seen(x - 0.5, y, c),
                                     seen(x, y + 0.5, c) - seen(x, y - 0.5, c), here);
        normal += slopes * slopes.transpose();
        right += slopes * (got - here);
        squares += (got - here) * (got - here);
        ++count;
      }
    }
  }
  const Eigen::Vector3d solution = normal.ldlt().solve(right);
  return {solution.head<2>(), 1 + solution.z(), 10 * std::log10(255.0 * 255.0 * count / squares)};
}

TEST(TruthRig, EveryHeadsPicture_IsTheTrueSphereSeenThroughItsLensGainAndVignetting) {
  NODAL_SHARED_FILE_OR_SKIP(text, "synthetic_10head/rig_gt.json");
  const Result<TruthRig> rig = read_truth_rig(text);
  ASSERT_TRUE(rig) << rig.error().text();
  const std::string folder = std::string(NODAL_SHARED_DIR) + "/data/synthetic_10head/";
  const auto sphere = media::read_image(folder + "gt_equirect_2048.png", PixelFormat::kRgb24);
  ASSERT_TRUE(sphere) << sphere.error().text();
  const auto layout = *geometry::make_layout("equirectangular", sphere->width, sphere->height);
  const Result<std::vector<Head>> heads = geometry::make_heads(rig->calibration);
  ASSERT_TRUE(heads) << heads.error().text();
  ASSERT_EQ(heads->size(), 10u);
  for (std::size_t h = 0; h < heads->size(); ++h) {
    const Head& head = (*heads)[h];
    const auto picture = media::read_image(folder + rig->images[h], PixelFormat::kRgb24);
    ASSERT_TRUE(picture) << picture.error().text();
    ASSERT_EQ(picture->width, head.width());
    const Difference difference = compare(head, picture->view(), sphere->view(), *layout);
    std::printf("%s: shifted by %.4f, %.4f px, factor %.4f, %.2f dB\n", head.name().c_str(), difference.shift.x(),
                difference.shift.y(), difference.factor, difference.psnr);
    EXPECT_LE(difference.shift.norm(), 0.03) << head.name();
    EXPECT_NEAR(difference.factor, 1, 0.01) << head.name();
    EXPECT_GE(difference.psnr, 29) << head.name();  // the pictures are sharper than the sphere at 2048 px
  }
}

TEST(TruthRig, CameraWithoutAFocal_IsNamed) {
  NODAL_SHARED_FILE_OR_SKIP(text, "synthetic_10head/rig_gt.json");
  std::string spoilt = text;
  const std::size_t second = spoilt.find("cam1.png");
  spoilt.replace(spoilt.find("\"f\"", second), 3, "\"g\"");
  const Result<TruthRig> rig = read_truth_rig(spoilt);
  ASSERT_FALSE(rig);
  EXPECT_NE(rig.error().message.find("cameras[1] has no f"), std::string::npos) << rig.error().text();
}

TEST(TruthRig, NotJson_IsRefused) {
  EXPECT_EQ(read_truth_rig("{").error().code, Errc::kBadFormat);
  EXPECT_EQ(read_truth_rig("{}").error().code, Errc::kMissingField);
}

}  // namespace
}  // namespace nodal::test_data
