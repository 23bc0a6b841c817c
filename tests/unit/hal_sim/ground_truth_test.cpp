// The renderer against ten pictures that another program rendered of the same sphere.
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <numeric>

#include "hal/sim/scene/plate.h"
#include "stitch/media/image_file.h"
#include "tests/data/truth_rig.h"

namespace nodal::hal::sim {
namespace {

const std::filesystem::path kFolder = std::filesystem::path(NODAL_SHARED_DIR) / "data/synthetic_10head";

struct Compared {
  double rms = 0;       ///< levels, green, over boxes of 9 x 9
  double mean = 0;      ///< levels, all channels
  double flat_rms = 0;  ///< levels where the scene is flat: the noise of the pictures
};

Compared compare(const HeadCalibration& head, const Scene& scene, const DecodedImage& picture) {
  const Plate plate = expose_plate(head, LensTruth(head), scene, 1);
  const auto w = static_cast<std::size_t>(plate.width);
  const auto h = static_cast<std::size_t>(plate.height);
  std::vector<double> off(w * h);
  Compared result;
  double flat = 0;
  std::size_t flats = 0;
  for (std::size_t c = 0; c < 3; ++c) {
    const std::vector<float>& light = plate.light[c];
    for (std::size_t y = 1; y + 1 < h; ++y) {
      for (std::size_t x = 1; x + 1 < w; ++x) {
        const std::size_t i = y * w + x;
        const int level = picture.bytes[3 * i + c];
        const double d = level - std::min(255.0, 255.0 * light[i]);
        result.mean += d;
        if (c == 1) off[i] = d;
        const double slope = std::abs(light[i + 1] - light[i - 1]) + std::abs(light[i + w] - light[i - w]);
        if (slope * 255 > 1 || level < 6 || level > 249) continue;
        flat += d * d;
        ++flats;
      }
    }
  }
  result.mean /= static_cast<double>(3 * w * h);
  result.flat_rms = std::sqrt(flat / static_cast<double>(flats));
  std::size_t boxes = 0;
  for (std::size_t y = 0; y + 9 <= h; y += 3) {
    for (std::size_t x = 0; x + 9 <= w; x += 3, ++boxes) {
      double sum = 0;
      for (std::size_t b = 0; b < 9; ++b) {
        const auto row = off.begin() + static_cast<std::ptrdiff_t>((y + b) * w + x);
        sum = std::accumulate(row, row + 9, sum);
      }
      result.rms += sum / 81 * sum / 81;
    }
  }
  result.rms = std::sqrt(result.rms / static_cast<double>(boxes));
  return result;
}

/// The minimum of the parabola through the errors at -step, 0, +step.
double least(double before, double here, double after, double step) {
  return 0.5 * step * (before - after) / (before - 2 * here + after);
}

// The pictures contain detail that the 2048 px wide sphere lacks, so pixels differ by more than noise. But in flat
// areas only noise is left, the mean is correct, and no shift, scale or rotation reduces the difference.
TEST(GroundTruth, TenHeadsRenderedElsewhere_TheSameRaysToAFiftiethOfAPixel) {
  if (!std::filesystem::exists(kFolder)) GTEST_SKIP() << "no " << kFolder;
  std::ifstream in(kFolder / "rig_gt.json");
  const std::string json{std::istreambuf_iterator<char>(in), {}};
  const auto rig = test_data::read_truth_rig(json);
  ASSERT_TRUE(rig) << rig.error().text();
  const auto sphere = media::read_image(kFolder / "gt_equirect_2048.png", PixelFormat::kRgb24);
  ASSERT_TRUE(sphere) << sphere.error().text();
  const ScenePtr scene = photo_scene(sphere->view(), Response{}).value();
  for (std::size_t i = 0; i < rig->images.size(); i += 3) {
    const HeadCalibration& head = rig->calibration.heads[i];
    const auto picture = media::read_image(kFolder / rig->images[i], PixelFormat::kRgb24);
    ASSERT_TRUE(picture) << picture.error().text();
    const auto with = [&](double dx, double dy, double stretch) {
      HeadCalibration moved = head;
      moved.center_x += dx;
      moved.center_y += dy;
      std::get<TsaiLens>(moved.lens).focal *= stretch;
      const double rms = compare(moved, *scene, *picture).rms;
      return rms * rms;
    };
    const Compared here = compare(head, *scene, *picture);
    const double square = here.rms * here.rms;
    const double x = least(with(-0.2, 0, 1), square, with(0.2, 0, 1), 0.2);
    const double y = least(with(0, -0.2, 1), square, with(0, 0.2, 1), 0.2);
    const double f = least(with(0, 0, 0.999), square, with(0, 0, 1.001), 0.001);
    std::printf("%s: flat rms %.2f, mean %+.3f, centre off by %+.4f %+.4f px, focal by %+.5f %%\n", head.name.c_str(),
                here.flat_rms, here.mean, x, y, 100 * f);
    EXPECT_LT(here.flat_rms, 2.5);
    EXPECT_GT(here.flat_rms, 1.8) << "the pictures have noise; where has it gone?";
    EXPECT_NEAR(here.mean, 0, 0.05);
    EXPECT_NEAR(x, 0, 0.02);
    EXPECT_NEAR(y, 0, 0.02);
    EXPECT_NEAR(f, 0, 5e-5);
  }
}

}  // namespace
}  // namespace nodal::hal::sim
