// `nodal view` beside ffmpeg's v360 and OpenCV's fisheye.
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
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
constexpr int kSide = 96;  ///< side of the views, px

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

/// How far `b` is beside `a`, px: least squares over the square from `first`. A constant difference is fitted too,
/// because v360 rounds down.
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

/// How far the worst of the quarters of two views is beside the other, px.
double worst_shift(const std::string& ours, const std::string& theirs) {
  const DecodedImage a = media::read_image(ours, PixelFormat::kGrey8).value();
  const DecodedImage b = media::read_image(theirs, PixelFormat::kGrey8).value();
  constexpr int kHalf = kSide / 2;
  double worst = 0;
  for (const Eigen::Array2i& corner : {Eigen::Array2i(2, 2), {kHalf, 2}, {2, kHalf}, {kHalf, kHalf}}) {
    worst = std::max(worst, shift(a, b, corner, kHalf - 2).cwiseAbs().maxCoeff());
  }
  return worst;
}

TEST_F(ViewPeer, EveryCamera_ShowsWhatFfmpegsV360Shows) {
  if (Process({"sh", "-c", "command -v ffmpeg"}).wait().code != 0) GTEST_SKIP() << "ffmpeg is not installed";
  // v360 takes the centres of the first and last pixels for -180 and 180 degrees: a picture this wide makes that
  // negligible.
  test::write_bytes(path("s.png"), smooth_sphere(4096));
  struct Pair {
    std::string camera;
    double fov;
    std::string v360;
  };
  // v360's pannini shows one focal length to each side, its mercator all around; its cylinders take their height as an
  // angle.
  const std::vector<Pair> pairs{
      {"perspective", 110, "flat:h_fov=110:v_fov=110"},
      {"pannini:d=0", 110, "flat:h_fov=110:v_fov=110"},
      {"fisheye", 200, "fisheye:h_fov=200:v_fov=200"},
      {"fisheye:f1=7", 200, "fisheye:h_fov=200:v_fov=200"},
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
    EXPECT_LT(worst_shift(path("a.png"), path("b.png")), 0.05) << pair.camera;
  }
}

TEST_F(ViewPeer, FisheyesWithCoefficients_ShowWhatOpenCvsFisheyeShows) {
  const std::string python = "/usr/bin/python3";  // Debian's interpreter, which finds Debian's modules
  if (Process({"sh", "-c", python + " -c 'import cv2, numpy'"}).wait().code != 0)
    GTEST_SKIP() << "Debian's python3-opencv is not installed";
  test::write_bytes(path("s.png"), smooth_sphere(1024));
  // theta_d = theta (1 + k1 theta^2 + k2 theta^4 + ...), which is r. It finds rays up to less than 90 degrees off the
  // axis.
  const std::string script = R"(
import sys, cv2, numpy as np
source, to, side, half = sys.argv[1], sys.argv[2], int(sys.argv[3]), np.radians(float(sys.argv[4]))
k = np.array([float(v) for v in sys.argv[5:]])
focal = side / 2 / (half * (1 + k @ half ** np.array([2, 4, 6, 8])))
K = np.array([[focal, 0, side / 2 - 0.5], [0, focal, side / 2 - 0.5], [0, 0, 1]])
y, x = np.mgrid[0:side, 0:side].astype(np.float64)
flat = cv2.fisheye.undistortPoints(np.stack([x, y], -1).reshape(1, -1, 2), K, k).reshape(side, side, 2)
theta, phi = np.arctan(flat[..., 0]), np.arctan2(flat[..., 1], np.hypot(1, flat[..., 0]))
sphere = cv2.imread(source, cv2.IMREAD_GRAYSCALE)
height, width = sphere.shape
columns, rows = (theta / (2 * np.pi) + 0.5) * width - 0.5, (phi / np.pi + 0.5) * height - 0.5
cv2.imwrite(to, cv2.remap(sphere, columns.astype(np.float32), rows.astype(np.float32), cv2.INTER_LINEAR))
)";
  const Finished ours = nodal({"view", path("s.png"), "--from", "equirectangular", "-o", path("a.png"), "--camera",
                               "fisheye:f3=0.08,f5=-0.02,f7=0.005,f9=-0.001", "--fov", "110", "--size", "96x96"});
  ASSERT_EQ(ours.code, 0) << ours.err;
  const auto shows = [&](const std::string& k1) {
    const Finished theirs =
        Process({python, "-c", script, path("s.png"), path("b.png"), "96", "55", k1, "-0.02", "0.005", "-0.001"})
            .wait();
    EXPECT_EQ(theirs.code, 0) << theirs.err;
    return worst_shift(path("a.png"), path("b.png"));
  };
  EXPECT_LT(shows("0.08"), 0.02);
  EXPECT_GT(shows("0.05"), 0.1) << "another lens is noticed";
}

}  // namespace
}  // namespace nodal::command_line
