// The ten-head rig whose true values an independent program wrote: gains within 15 %, a fall-off, noise.
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <sstream>

#include "stitch/calibration/light/calibrate_light.h"
#include "stitch/media/image_file.h"
#include "tests/data/truth_rig.h"

namespace nodal::calibration {
namespace {

namespace fs = std::filesystem;

TEST(SyntheticRig, GainsAndFallOffOfOneSet_ComeBackToAHundredthOfAStop) {
  const fs::path folder = fs::path(NODAL_SHARED_DIR) / "data" / "synthetic_10head";
  if (!fs::exists(folder / "rig_gt.json")) GTEST_SKIP() << folder << " is not there";
  std::ostringstream text;
  text << std::ifstream(folder / "rig_gt.json").rdbuf();
  const auto truth = test_data::read_truth_rig(text.str());
  ASSERT_TRUE(truth) << truth.error().text();
  Calibration prior = truth->calibration;
  for (HeadCalibration& head : prior.heads) {
    head.gain = {1, 1, 1};
    head.vignetting.coefficients = {};
  }
  std::vector<DecodedImage> pictures;
  ExposedSet set;
  for (const std::string& image : truth->images) {
    auto picture = media::read_image(folder / image, PixelFormat::kRgb24);
    ASSERT_TRUE(picture) << picture.error().text();
    pictures.push_back(std::move(*picture));
  }
  for (const auto& picture : pictures) set.frames.push_back(picture.view());

  const auto found = calibrate_light(prior, {set}, {});
  ASSERT_TRUE(found) << found.error().text();
  double mean = 0;  // mean of the true gains; the pictures do not determine it
  for (const HeadCalibration& head : truth->calibration.heads) mean += std::log2(head.gain[1]) / 10;
  for (std::size_t h = 0; h < 10; ++h) {
    const HeadCalibration& ours = found->calibration.heads[h];
    const HeadCalibration& theirs = truth->calibration.heads[h];
    for (std::size_t c = 0; c < 3; ++c) {
      EXPECT_NEAR(std::log2(ours.gain[c]), std::log2(theirs.gain[c]) - mean, 0.01) << ours.name;
    }
    const auto left = [](const HeadCalibration& head, double px) {
      const double s = std::pow(px / head.vignetting.radius, 2);
      const auto& v = head.vignetting.coefficients;
      return std::log2(1 + s * (v[0] + s * (v[1] + s * v[2])));
    };
    for (const double px : {200.0, 300.0, 400.0}) EXPECT_NEAR(left(ours, px), left(theirs, px), 0.01) << ours.name;
  }
  EXPECT_LT(found->after_stops, 0.02);
}

}  // namespace
}  // namespace nodal::calibration
