// A real rig, from another program's project to a pulled raymap: three fisheyes on a rooftop, compared with the stitch
// by Hugin's nona and enblend from the same numbers.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <filesystem>

#include "rig_process.h"
#include "stitch/geometry/raymap/layout.h"
#include "stitch/media/image_file.h"
#include "tests/reference/png_file.h"
#include "tests/reference/score.h"

namespace nodal::command_line {
namespace {

namespace fs = std::filesystem;

constexpr int kWidth = 2048;
constexpr int kHeight = 1024;

int green(const ImageView& image, int x, int y) {
  const PlaneView& plane = image.planes[1];
  return plane.data[y * plane.row_stride + std::ptrdiff_t{x} * plane.pixel_stride];
}

double mean_step(const ImageView& image, int left, int right) {
  double sum = 0;
  for (int y = 0; y < image.height; ++y) sum += std::abs(green(image, left, y) - green(image, right, y));
  return sum / image.height;
}

/// Sum of absolute differences between a window of `a` and the shifted window of `b`.
long window_difference(const ImageView& a, const ImageView& b, int x0, int y0, int side, int dx, int dy) {
  long sum = 0;
  for (int y = y0; y < y0 + side; ++y) {
    for (int x = x0; x < x0 + side; ++x) sum += std::abs(green(a, x, y) - green(b, x + dx, y + dy));
  }
  return sum;
}

bool has_detail(const ImageView& image, int x0, int y0, int side) {
  long across = 0;
  long down = 0;
  for (int y = y0; y < y0 + side; ++y) {
    for (int x = x0; x < x0 + side; ++x) {
      across += std::abs(green(image, x + 1, y) - green(image, x, y));
      down += std::abs(green(image, x, y + 1) - green(image, x, y));
    }
  }
  return std::min(across, down) > 4L * side * side;
}

struct Shifts {
  int windows = 0;
  int within_one_pixel = 0;
};

/// Counts the windows between the rows, with detail in both directions, that are at the reference's position.
Shifts shifts_against(const ImageView& raymap, const ImageView& reference, int top, int bottom) {
  constexpr int kSide = 48;
  constexpr int kReach = 4;
  Shifts shifts;
  for (int y = top; y + kSide <= bottom; y += kSide) {
    for (int x = kReach; x + kSide + kReach < kWidth; x += kSide) {
      if (!has_detail(reference, x, y, kSide)) continue;
      std::array<int, 2> best{};
      long least = -1;
      for (int dy = -kReach; dy <= kReach; ++dy) {
        for (int dx = -kReach; dx <= kReach; ++dx) {
          const long here = window_difference(raymap, reference, x, y, kSide, dx, dy);
          if (least < 0 || here < least) {
            least = here;
            best = {dx, dy};
          }
        }
      }
      ++shifts.windows;
      shifts.within_one_pixel += std::abs(best[0]) <= 1 && std::abs(best[1]) <= 1;
    }
  }
  return shifts;
}

using RealRig = RigTest;

// Near the rooftop rig the stitches differ: its heads are a hand apart, and enblend cuts where Nodal blends. So bounds
// for the whole are loose; those for distant objects (above the horizon, almost no parallax) are tight.
TEST_F(RealRig, RooftopImportedReplayedUploadedPulled_IsTheReferenceStitch) {
  const fs::path data = fs::path(NODAL_SHARED_DIR) / "data" / "stitchem_3cam";
  if (!fs::exists(data / "3_Cam_-_Sample.pts")) GTEST_SKIP() << data << " is not there: no real rig is stitched";

  const Finished imported = nodal(
      {"import", (data / "3_Cam_-_Sample.pts").string(), "-o", path("rooftop.json"), "--rig-toml", path("rig.toml")});
  ASSERT_EQ(imported.code, 0) << imported.err;
  start_nodald();
  const Finished uploaded = nodal({"--timeout", "60s", "calibration", "upload", path("rooftop.json")});
  ASSERT_EQ(uploaded.code, 0) << uploaded.err;
  const Finished pulled = nodal({"--timeout", "60s", "raymap", "pull", "--out", path("raymap.png")});
  ASSERT_EQ(pulled.code, 0) << pulled.err;
  nodald().signal(SIGTERM);
  EXPECT_EQ(nodald().wait().code, 0);

  const test::Picture raymap = test::read_png(path("raymap.png")).value();
  const DecodedImage reference =
      media::read_image(data / "reference_stitch_ptgui_params_nona_2048.jpg", PixelFormat::kRgb24).value();
  ASSERT_EQ(raymap.width, kWidth);
  ASSERT_EQ(raymap.height, kHeight);
  ASSERT_EQ(reference.width, kWidth);
  const auto layout = geometry::make_layout("equirectangular", kWidth, kHeight).value();

  const test::Score score = test::score(raymap.view(), reference.view(), *layout);
  const double similar = test::ssim(raymap.view(), reference.view(), *layout);
  EXPECT_GE(score.psnr_db, 25.5) << "near objects differ: the reference's seams lie elsewhere";
  EXPECT_GE(similar, 0.9);
  EXPECT_GE(score.covered, 0.999);

  const Shifts far = shifts_against(raymap.view(), reference.view(), 300, 560);
  EXPECT_GE(far.windows, 50);
  EXPECT_GE(far.within_one_pixel, far.windows * 85 / 100);

  const double inside = (mean_step(raymap.view(), 500, 501) + mean_step(raymap.view(), 1500, 1501)) / 2;
  EXPECT_LE(mean_step(raymap.view(), kWidth - 1, 0), 1.5 * inside) << "the sphere does not close behind";

  std::printf("rooftop: psnr %.2f dB, ssim %.3f, %d of %d far windows within 1 px; step behind %.2f, inside %.2f\n",
              score.psnr_db, similar, far.within_one_pixel, far.windows, mean_step(raymap.view(), kWidth - 1, 0),
              inside);
}

}  // namespace
}  // namespace nodal::command_line
