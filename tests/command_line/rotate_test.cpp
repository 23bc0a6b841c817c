// `nodal convert --rotate` beside a scene that is rendered for the turned camera.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <filesystem>

#include "picture_command.h"
#include "smooth_scene.h"
#include "stitch/media/image_file.h"
#include "tests/support/layouts.h"
#include "tests/support/pictures.h"

namespace nodal::command_line {
namespace {

using RotateCommand = PictureCommand;

/// The scene as an equirectangular raymap of a camera that is turned right by yaw, up by pitch, then clockwise by roll.
std::vector<std::uint8_t> scene_from(int width, double yaw, double pitch, double roll) {
  const auto turn = [](double& a, double& b, double degrees) {
    const double angle = degrees * 0.017453292519943295, c = std::cos(angle), s = std::sin(angle);
    const double turned = c * a + s * b;
    b = c * b - s * a;
    a = turned;
  };
  std::vector<std::uint8_t> rgb;
  for (int y = 0; y < width / 2; ++y) {
    for (int x = 0; x < width; ++x) {
      const double theta = 6.283185307179586 * ((x + 0.5) / width - 0.5);
      const double phi = 6.283185307179586 * ((y + 0.5) / width - 0.25);
      double right = std::sin(theta) * std::cos(phi), down = std::sin(phi), forward = std::cos(theta) * std::cos(phi);
      turn(down, right, roll);  // clockwise: what is to the right in the picture is lower in the scene
      turn(forward, down, pitch);
      turn(right, forward, yaw);
      const auto colour = scene_at({right, down, forward});
      rgb.insert(rgb.end(), colour.begin(), colour.end());
    }
  }
  return rgb;
}

TEST_F(RotateCommand, Rotate_ShowsWhatACameraThatIsTurnedSees_InEveryLayout) {
  constexpr int kWide = 256;
  test::write_bytes(path("sphere.png"), test::png_of(scene_from(kWide, 0, 0, 0), kWide, kWide / 2, 3));
  const auto turned = [&](double yaw, double pitch, double roll) {
    test::write_bytes(path("truth.png"), test::png_of(scene_from(kWide, yaw, pitch, roll), kWide, kWide / 2, 3));
  };
  for (const auto& [yaw, pitch, roll] :
       std::vector<std::array<double, 3>>{{90, 0, 0}, {0, 90, 0}, {0, 0, 90}, {30, -70, 200}}) {
    turned(yaw, pitch, roll);
    const std::string angles = std::to_string(yaw) + "," + std::to_string(pitch) + "," + std::to_string(roll);
    const Finished run = nodal(
        {"convert", path("sphere.png"), "--from", "equirectangular", "--rotate", angles, "-o", path("turned.png")});
    ASSERT_EQ(run.code, 0) << run.err;
    EXPECT_GT(psnr_of("turned.png", "truth.png"), 45) << angles;
  }
  turned(30, -70, 200);
  for (const geometry::LayoutKind& kind : geometry::layout_kinds()) {
    if (!test::holds_whole_sphere(kind)) continue;
    const std::string name(kind.name);
    const Finished outward = nodal({"convert", path("sphere.png"), "--from", "equirectangular", "--rotate",
                                    "30,-70,200", "-o", path(name + ".png"), "--layout", name, "--width", "512"});
    ASSERT_EQ(outward.code, 0) << outward.err;
    const Finished back =
        nodal({"convert", path(name + ".png"), "--from", name, "-o", path("back.png"), "--width", "256"});
    ASSERT_EQ(back.code, 0) << back.err;
    EXPECT_GT(psnr_of("back.png", "truth.png"), name == "stratified_random" ? 34 : 40) << name;
  }
  EXPECT_LT(psnr_of("sphere.png", "truth.png"), 20) << "a measure that does not see the rotation is none";
}

TEST_F(RotateCommand, Rotate_OfNonsense_IsRefused) {
  test::write_bytes(path("sphere.png"), test::png_of(scene_from(64, 0, 0, 0), 64, 32, 3));
  for (const char* angles :
       {"", "90", "nan,0,0", "inf,0,0", "0,91,0", "1e308,0,0", "0,0,0,0", "0;0;0", "a,b,c", "0,0,"})
    expect_refused(
        {"convert", path("sphere.png"), "--from", "equirectangular", "-o", path("out.png"), "--rotate", angles},
        "--rotate");
  EXPECT_FALSE(std::filesystem::exists(path("out.png")));
}

}  // namespace
}  // namespace nodal::command_line
