// `nodal stitch --up`, and the calibration beside a sphere that `nodal convert --rotate` turned.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "stitch/media/image_file.h"
#include "stitch_command.h"

namespace nodal::command_line {
namespace {

/// Mean of the absolute differences of two pictures, levels.
double difference(const DecodedImage& a, const DecodedImage& b) {
  EXPECT_EQ(a.bytes.size(), b.bytes.size());
  double sum = 0;
  for (std::size_t k = 0; k < std::min(a.bytes.size(), b.bytes.size()); ++k)
    sum += std::abs(static_cast<double>(a.bytes[k]) - static_cast<double>(b.bytes[k]));
  return sum / static_cast<double>(a.bytes.size());
}

TEST_F(StitchCommand, ATurnedSphereAndTheCalibrationBesideIt_BelongTogether) {
  write_pictures("pictures");
  ASSERT_EQ(nodal({"stitch", path("rig.json"), path("pictures"), "-o", path("sphere.png")}).code, 0);
  write("sphere.rig.json", to_json(town().truth));
  const Finished run = nodal({"convert", path("sphere.png"), "--rotate", "70,-40,25", "-o", path("turned.png")});
  ASSERT_EQ(run.code, 0) << run.err;
  EXPECT_NE(run.out.find("turned.rig.json"), std::string::npos) << run.out;
  ASSERT_EQ(nodal({"stitch", path("turned.rig.json"), path("pictures"), "-o", path("again.png")}).code, 0);
  const auto image = [&](const char* name) { return media::read_image(path(name), PixelFormat::kRgb24).value(); };
  const double apart = difference(image("turned.png"), image("again.png"));
  EXPECT_LT(apart, 0.3 * difference(image("sphere.png"), image("again.png"))) << apart;
  expect_refused({path("rig.json"), path("pictures"), "-o", path("turned.rig.png"), "--up", "nan,0"}, "--up");
}

TEST_F(StitchCommand, Up_IsADirectionOfTheSphereOrHowThePicturesAreHeld) {
  write_pictures("pictures");
  const auto sphere = [&](const std::string& rig, const std::string& up) {
    const Finished run = nodal({"stitch", path(rig), path("pictures"), "--up", up, "-o", path("out.png")});
    EXPECT_EQ(run.code, 0) << run.err;
    return media::read_image(path("out.png"), PixelFormat::kRgb24).value();
  };
  const DecodedImage level = sphere("rig.json", "auto");
  // The same rig in a frame that lies on its side: what was up is at the right.
  Calibration fallen = town().truth;
  for (HeadCalibration& head : fallen.heads) {
    const auto R = head.R_head_rig;  // x_new = -y, y_new = x: up (0, -1, 0) becomes (1, 0, 0)
    head.R_head_rig = {-R[1], R[0], R[2], -R[4], R[3], R[5], -R[7], R[6], R[8]};
  }
  write("fallen.json", to_json(fallen));
  EXPECT_GT(difference(sphere("fallen.json", "auto"), level), 20);
  EXPECT_LT(difference(sphere("fallen.json", "90,0"), level), 0.5);
  EXPECT_LT(difference(sphere("fallen.json", "pictures"), level), 0.5) << "four of the six heads are level";
  EXPECT_LT(difference(sphere("rig.json", "17,90"), level), 0.5) << "up is up already";
  for (const char* nonsense : {"", "up", "nan,0", "0,inf", "0,91", "361,0", "0,0,0", "0", "1e999,0"})
    expect_refused({path("rig.json"), path("pictures"), "-o", path("bad.png"), "--up", nonsense}, "--up");
  for (const char* beyond : {"400,100", "0,-91", "-361,0", "1e999,0"})
    expect_refused({path("rig.json"), path("pictures"), "-o", path("bad.png"), "--up", beyond},
                   "YAW is a number from -360 to 360 and PITCH one from -90 to 90");
}

}  // namespace
}  // namespace nodal::command_line
