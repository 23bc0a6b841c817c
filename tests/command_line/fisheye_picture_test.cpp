// `nodal convert --from fisheye:fov=...` and `dual_fisheye:fov=...` beside a scene that is rendered by a
// formula, and beside ffmpeg's v360.
#include <gtest/gtest.h>

#include <cmath>
#include <string>

#include "rig_process.h"
#include "smooth_scene.h"
#include "stitch/media/image_file.h"
#include "tests/support/pictures.h"

namespace nodal::command_line {
namespace {

constexpr double kTurnHalf = 3.14159265358979323846;
constexpr int kCircle = 400;       // px
constexpr int kSphereWidth = 512;  // width of the sphere, px

/// A circle of an equidistant lens that looks forward or back, in a picture of this size; black around it.
void add_circle(std::vector<std::uint8_t>& rgb, int width, int left, int top, double fov, bool back) {
  for (int y = 0; y < kCircle; ++y) {
    for (int x = 0; x < kCircle; ++x) {
      const double dx = x + 0.5 - kCircle / 2.0, dy = y + 0.5 - kCircle / 2.0, r = std::hypot(dx, dy);
      if (r > kCircle / 2.0) continue;
      const double angle = r / (kCircle / 2.0) * fov / 2 * kTurnHalf / 180, sign = back ? -1 : 1;
      const auto colour = scene_at({sign * dx / r * std::sin(angle), dy / r * std::sin(angle), sign * std::cos(angle)});
      std::copy(colour.begin(), colour.end(), rgb.begin() + 3 * (std::ptrdiff_t{top + y} * width + left + x));
    }
  }
}

/// The sphere that shows the scene up to this angle from the forward axis, and how often each byte counts.
std::vector<std::uint8_t> sphere_up_to(double degrees) {
  std::vector<std::uint8_t> rgb;
  for (int y = 0; y < kSphereWidth / 2; ++y) {
    for (int x = 0; x < kSphereWidth; ++x) {
      const double theta = 2 * kTurnHalf * ((x + 0.5) / kSphereWidth - 0.5),
                   phi = 2 * kTurnHalf * ((y + 0.5) / kSphereWidth - 0.25);
      const std::array<double, 3> ray{std::sin(theta) * std::cos(phi), std::sin(phi), std::cos(theta) * std::cos(phi)};
      const bool seen = std::acos(ray[2]) <= degrees * kTurnHalf / 180;
      const auto colour = seen ? scene_at(ray) : std::array<std::uint8_t, 3>{};
      rgb.insert(rgb.end(), colour.begin(), colour.end());
    }
  }
  return rgb;
}

/// Share of the bytes that differ by more than two levels.
double share_of_differences(const std::vector<std::uint8_t>& a, const std::vector<std::uint8_t>& b) {
  EXPECT_EQ(a.size(), b.size());
  std::size_t count = 0;
  for (std::size_t k = 0; k < std::min(a.size(), b.size()); ++k) count += std::abs(a[k] - b[k]) > 2 ? 1 : 0;
  return static_cast<double>(count) / static_cast<double>(a.size());
}

class FisheyePictures : public RigTest {
 protected:
  std::vector<std::uint8_t> converted(const std::string& from) const {
    const Finished run = nodal(
        {"convert", path("lens.png"), "--from", from, "--width", std::to_string(kSphereWidth), "-o", path("out.png")});
    EXPECT_EQ(run.code, 0) << run.err;
    return run.code == 0 ? media::read_image(path("out.png"), PixelFormat::kRgb24).value().bytes
                         : std::vector<std::uint8_t>();
  }
  void write_dual(double fov, bool stacked) const {
    const int width = stacked ? kCircle : 2 * kCircle, height = stacked ? 2 * kCircle : kCircle;
    std::vector<std::uint8_t> rgb(std::size_t{3} * 2 * kCircle * kCircle);
    add_circle(rgb, width, 0, 0, fov, false);
    add_circle(rgb, width, stacked ? 0 : kCircle, stacked ? kCircle : 0, fov, true);
    test::write_bytes(path("lens.png"), test::png_of(rgb, width, height, 3));
  }
};

TEST_F(FisheyePictures, TwoCircles_AreTheWholeSphere) {
  for (const bool stacked : {false, true}) {
    write_dual(195.5, stacked);
    EXPECT_LT(share_of_differences(converted("dual_fisheye:fov=195.5"), sphere_up_to(180)), 0.001) << stacked;
    EXPECT_GT(share_of_differences(converted("dual_fisheye:fov=180.5"), sphere_up_to(180)), 0.3) << "of another lens";
  }
}

TEST_F(FisheyePictures, TwoCircles_AreTheWholeSphereForFfmpegsV360Too) {
  if (Process({"sh", "-c", "command -v ffmpeg"}).wait().code != 0) GTEST_SKIP() << "ffmpeg is not installed";
  write_dual(195, false);
  const std::string filter = "v360=dfisheye:e:ih_fov=195:iv_fov=195:yaw=180:w=" + std::to_string(kSphereWidth) +
                             ":h=" + std::to_string(kSphereWidth / 2);
  const Finished theirs = Process({"ffmpeg", "-v", "error", "-y", "-i", path("lens.png"), "-vf", filter, "-frames:v",
                                   "1", "-pix_fmt", "rgb24", path("theirs.png")})
                              .wait();
  ASSERT_EQ(theirs.code, 0) << theirs.err;
  const auto peer = media::read_image(path("theirs.png"), PixelFormat::kRgb24).value().bytes;
  EXPECT_GT(test::psnr(peer, converted("dual_fisheye:fov=195")), 34);
}

TEST_F(FisheyePictures, OneCircle_IsAPartOfTheSphereAlsoInAWiderPicture) {
  for (const int margin : {0, 100}) {
    const int width = kCircle + 2 * margin;
    std::vector<std::uint8_t> rgb(static_cast<std::size_t>(3 * width * kCircle));
    add_circle(rgb, width, margin, 0, 220, false);
    test::write_bytes(path("lens.png"), test::png_of(rgb, width, kCircle, 3));
    EXPECT_LT(share_of_differences(converted("fisheye:fov=220"), sphere_up_to(110)), 0.01) << "but for the rim";
  }
  ASSERT_EQ(
      nodal({"view", path("lens.png"), "--from", "fisheye:fov=220", "-o", path("view.png"), "--size", "64x48"}).code,
      0);
}

TEST_F(FisheyePictures, NonsenseIsRefused) {
  write_dual(190, false);
  for (const char* from : {"fisheye", "fisheye:", "fisheye:fov=", "fisheye:fov=nan", "fisheye:fov=9", "fisheye:fov=361",
                           "dual_fisheye:fov=1e400", "dual_fisheye:fov=-190", "fisheye:fov=190,5", "fisheye:pad=4"}) {
    const Finished run = nodal({"convert", path("lens.png"), "--from", from, "-o", path("no.png")});
    EXPECT_EQ(run.code, 2) << from << run.err;
    EXPECT_NE(run.err.find("--from"), std::string::npos) << run.err;
  }
}

}  // namespace
}  // namespace nodal::command_line
