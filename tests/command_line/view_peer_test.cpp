// `nodal view` beside ffmpeg's v360.
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <numbers>
#include <string>
#include <vector>

#include "rig_process.h"
#include "stitch/geometry/ray.h"
#include "stitch/media/image_file.h"
#include "tests/support/pictures.h"

namespace nodal::command_line {
namespace {

using ViewPeer = RigTest;
constexpr double kPi = std::numbers::pi;
constexpr int kSide = 96;  ///< of the views, px

/// A smooth equirectangular picture, 30 to 226, with detail in every direction.
std::vector<std::uint8_t> smooth_sphere(int width) {
  std::vector<std::uint8_t> grey;
  for (int y = 0; y < width / 2; ++y) {
    const geometry::SinCos phi = geometry::SinCos::of(kPi * (2 * y + 1) / width - kPi / 2);
    for (int x = 0; x < width; ++x) {
      const geometry::Ray ray = geometry::Ray::at(geometry::SinCos::of(kPi * (2 * x + 1) / width - kPi), phi);
      grey.push_back(static_cast<std::uint8_t>(128 + 40 * std::sin(9 * ray.x() + 1) +
                                               30 * std::sin(8 * ray.y() + 2 * ray.x()) +
                                               28 * std::cos(7 * ray.z() - 3 * ray.y())));
    }
  }
  return test::png_of(grey, width, width / 2, 1);
}

/// How far `b` is beside `a`, px: least squares over the square from `first`. A constant difference is fitted too, because
/// v360 rounds down.
Eigen::Vector2d shift(const DecodedImage& a, const DecodedImage& b, Eigen::Array2i first, int side) {
  Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
  Eigen::Vector3d sums = Eigen::Vector3d::Zero();
  const auto at = [](const DecodedImage& image, int x, int y) {
    return static_cast<double>(image.bytes[static_cast<std::size_t>(y * image.width + x)]);
  };
  for (int y = first.y(); y < first.y() + side; ++y) {
    for (int x = first.x(); x < first.x() + side; ++x) {
      const Eigen::Vector3d slope((at(a, x + 1, y) - at(a, x - 1, y)) / 2, (at(a, x, y + 1) - at(a, x, y - 1)) / 2, 1);
      const double difference = at(b, x, y) - at(a, x, y);
      if (slope.norm() > 40 || std::abs(difference) > 15) continue;  // at the edge of a disc
      normal += slope * slope.transpose(), sums -= slope * difference;
    }
  }
  return (normal.inverse() * sums).head<2>();
}

TEST_F(ViewPeer, EveryCamera_ShowsWhatFfmpegsV360Shows) {
  if (Process({"sh", "-c", "command -v ffmpeg"}).wait().code != 0) GTEST_SKIP() << "ffmpeg is not installed";
  // v360 takes the centres of the first and last pixels for -180 and 180 degrees: a picture this wide makes that negligible.
  test::write_bytes(path("s.png"), smooth_sphere(4096));
  struct Pair {
    std::string camera;
    double fov;
    std::string v360;
  };
  // v360's pannini shows one focal length to each side, its mercator all around; its cylinders take their height as an angle.
  const std::vector<Pair> pairs{
      {"perspective", 110, "flat:h_fov=110:v_fov=110"},
      {"pannini:d=0", 110, "flat:h_fov=110:v_fov=110"},
      {"fisheye", 200, "fisheye:h_fov=200:v_fov=200"},
      {"stereographic", 240, "sg:h_fov=240:v_fov=240"},
      {"equisolid", 240, "equisolid:h_fov=240:v_fov=240"},
      {"orthographic", 170, "og:h_fov=170:v_fov=170"},
      {"pannini", 4 * std::atan(0.5) * 180 / kPi, "pannini:h_fov=1"},
      {"cylindrical", 120, "cylindrical:h_fov=120:v_fov=" + std::to_string(2 * std::atan(kPi / 3) * 180 / kPi)},
      {"cylinder_equal_area", 100, "cylindricalea:h_fov=100:v_fov=" + std::to_string(180 * 50 * kPi / 180)},
      {"mercator", 360, "mercator"},
      {"equirectangular", 180, "hequirect"}};
  for (const Pair& pair : pairs) {
    const std::string side = std::to_string(kSide);
    const Finished ours =
        nodal({"view", path("s.png"), "--from", "equirectangular", "-o", path("a.png"), "--camera", pair.camera,
               "--fov", std::to_string(pair.fov), "--size", side + "x" + side, "--yaw", "20"});
    ASSERT_EQ(ours.code, 0) << ours.err;
    const std::string filter = "v360=e:" + pair.v360 + ":w=" + side + ":h=" + side + ":interp=line:yaw=20";
    const Finished theirs =
        Process({"ffmpeg", "-v", "error", "-y", "-i", path("s.png"), "-vf", filter, "-frames:v", "1", path("b.png")})
            .wait();
    ASSERT_EQ(theirs.code, 0) << theirs.err;
    const DecodedImage a = media::read_image(path("a.png"), PixelFormat::kGrey8).value();
    const DecodedImage b = media::read_image(path("b.png"), PixelFormat::kGrey8).value();
    constexpr int kHalf = kSide / 2;
    for (const Eigen::Array2i& corner : {Eigen::Array2i(2, 2), {kHalf, 2}, {2, kHalf}, {kHalf, kHalf}}) {
      const Eigen::Vector2d off = shift(a, b, corner, kHalf - 2);
      EXPECT_LT(off.cwiseAbs().maxCoeff(), 0.05) << pair.camera << " from " << corner.transpose();
    }
  }
}

}  // namespace
}  // namespace nodal::command_line
