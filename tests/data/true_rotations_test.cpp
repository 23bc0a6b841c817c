// Registration of a rig rendered by another program: synthetic_10head and its true rotations.
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <iterator>

#include "stitch/media/image_file.h"
#include "stitch/registration/registration.h"
#include "tests/data/truth_rig.h"
#include "tests/support/rendered_rig.h"

namespace nodal::registration {
namespace {

namespace fs = std::filesystem;

class TrueRotations : public testing::Test {
 protected:
  void SetUp() override {
    const fs::path folder = fs::path(NODAL_SHARED_DIR) / "data" / "synthetic_10head";
    if (!fs::exists(folder / "rig_gt.json"))
      GTEST_SKIP() << folder << " is not there: registration is not held against it";
    std::ifstream stream(folder / "rig_gt.json");
    const std::string text{std::istreambuf_iterator<char>(stream), std::istreambuf_iterator<char>()};
    Result<test_data::TruthRig> rig = test_data::read_truth_rig(text);
    ASSERT_TRUE(rig) << rig.error().text();
    truth_ = std::move(rig->calibration);
    for (const std::string& image : rig->images) {
      Result<DecodedImage> picture = media::read_image(folder / image, PixelFormat::kRgb24);
      ASSERT_TRUE(picture) << picture.error().text();
      pictures_.push_back(std::move(*picture));
    }
  }

  /// The rotation error after registration from a start with such errors and unknown light.
  double rms_from(double least_deg, double most_deg, std::uint64_t seed) const {
    Calibration prior = test::turned(truth_, least_deg, most_deg, seed);
    FrameSet frames;
    for (const DecodedImage& picture : pictures_) frames.push_back(picture.view());
    for (HeadCalibration& head : prior.heads) {
      head.gain = {1, 1, 1};
      head.vignetting.coefficients = {};
    }
    const Result<Report> report = register_heads(prior, {frames}, {});
    EXPECT_TRUE(report) << "seed " << seed << ": " << report.error().text();
    return report ? test::rotation_error(truth_, report->calibration).rms_deg : 180;
  }

  Calibration truth_;
  std::vector<DecodedImage> pictures_;
};

// A fortieth of Hugin's and OpenCV's error (tests/bench/registration); a hundredth of a pixel is 0.0013 degrees.
constexpr double kBarDeg = 0.0005;

TEST_F(TrueRotations, HeadsTwoToFiveDegreesOff_AreFoundToAFractionOfAHundredthPixel) {
  EXPECT_LE(rms_from(2, 5, 1), kBarDeg);
}

TEST_F(TrueRotations, HeadsEightDegreesOff_AreFoundAlsoWhereTheyFirstFallIntoTwoGroups) {
  EXPECT_LE(rms_from(8, 8, 1), kBarDeg);
  EXPECT_LE(rms_from(8, 8, 9), kBarDeg) << "each of four heads agrees with the other three, and with nobody else";
}

}  // namespace
}  // namespace nodal::registration
