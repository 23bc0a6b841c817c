// A cube as six files, out and in again.
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>

#include "rig_process.h"
#include "stitch/geometry/raymap/layout.h"
#include "stitch/media/image_file.h"
#include "tests/support/pictures.h"

namespace nodal::command_line {
namespace {

namespace fs = std::filesystem;

class Faces : public RigTest {
 protected:
  static constexpr int kWidth = 256;
  /// A sphere whose red grows to the right, whose green grows upwards and whose blue grows to the front, with the ray.
  void write_sphere() const {
    const auto layout = geometry::make_layout("equirectangular", kWidth, kWidth / 2).value();
    std::vector<std::uint8_t> bytes;
    for (int y = 0; y < kWidth / 2; ++y) {
      for (int x = 0; x < kWidth; ++x) {
        const geometry::Ray ray = *layout->ray(x + 0.5, y + 0.5);
        for (const double part : {ray.x(), -ray.y(), ray.z()})
          bytes.push_back(static_cast<std::uint8_t>(std::lround(128 + 100 * part)));
      }
    }
    test::write_bytes(path("sphere.png"), test::png_of(bytes, kWidth, kWidth / 2, 3));
  }
  std::vector<int> middle_of(const std::string& file) const {
    const DecodedImage face = media::read_image(path(file), PixelFormat::kRgb24).value();
    EXPECT_EQ(face.width, face.height) << file;
    const std::size_t at = 3 * (static_cast<std::size_t>(face.height / 2) * static_cast<std::size_t>(face.width) +
                                static_cast<std::size_t>(face.width / 2));
    return {face.bytes[at], face.bytes[at + 1], face.bytes[at + 2]};
  }
};

TEST_F(Faces, SixFiles_LookWhereTheirNamesSayAndMakeTheSphereAgain) {
  write_sphere();
  ASSERT_EQ(
      nodal({"convert", path("sphere.png"), "--from", "equirectangular", "--layout", "faces", "-o", path("town.png")})
          .code,
      0);
  EXPECT_FALSE(fs::exists(path("town.png")));
  const auto near = [](const std::vector<int>& is, const std::vector<int>& wanted) {
    for (std::size_t c = 0; c < 3; ++c) EXPECT_NEAR(is[c], wanted[c], 4);
  };
  near(middle_of("town_right.png"), {228, 128, 128});
  near(middle_of("town_left.png"), {28, 128, 128});
  near(middle_of("town_up.png"), {128, 228, 128});
  near(middle_of("town_down.png"), {128, 28, 128});
  near(middle_of("town_front.png"), {128, 128, 228});
  near(middle_of("town_back.png"), {128, 128, 28});
  // In any order, by other words for the same faces.
  fs::rename(path("town_up.png"), path("town-top.png"));
  fs::rename(path("town_left.png"), path("town.L.png"));
  Words words{"convert", "--from", "faces", "--width", std::to_string(kWidth), "-o", path("again.png")};
  for (const char* file :
       {"town_front.png", "town-top.png", "town_right.png", "town_back.png", "town.L.png", "town_down.png"})
    words.push_back(path(file));
  const Finished back = nodal(words);
  ASSERT_EQ(back.code, 0) << back.err;
  const DecodedImage was = media::read_image(path("sphere.png"), PixelFormat::kRgb24).value();
  const DecodedImage is = media::read_image(path("again.png"), PixelFormat::kRgb24).value();
  ASSERT_EQ(is.bytes.size(), was.bytes.size());
  int worst = 0;
  for (std::size_t k = 0; k < was.bytes.size(); ++k) worst = std::max(worst, std::abs(is.bytes[k] - was.bytes[k]));
  EXPECT_LE(worst, 6) << "a smooth sphere, sampled twice";
}

TEST_F(Faces, AFaceThatIsThereAlready_IsKeptAndNoOtherIsWritten) {
  const Refusing overwriting;
  write_sphere();
  write("town_back.png", "a picture of somebody's");
  const Finished run =
      nodal({"convert", path("sphere.png"), "--from", "equirectangular", "--layout", "faces", "-o", path("town.png")});
  EXPECT_NE(run.code, 0);
  EXPECT_NE(run.err.find("town_back.png: is there already"), std::string::npos) << run.err;
  EXPECT_EQ(read("town_back.png"), "a picture of somebody's");
  EXPECT_FALSE(fs::exists(path("town_right.png"))) << "refused before the work";
}

TEST_F(Faces, WhatIsNoCube_IsRefusedByItsName) {
  write_sphere();
  const auto refused = [&](Words words, const std::string& says) {
    words.insert(words.begin(), "convert");
    const Finished run = nodal(words);
    EXPECT_NE(run.code, 0) << says;
    EXPECT_NE(run.err.find(says), std::string::npos) << run.err;
  };
  refused({path("sphere.png"), "--from", "faces", "-o", path("o.png")}, "a cube has six files, and 1 were given");
  for (const char* name : {"a_right", "a_left", "a_up", "a_down", "a_front", "a_side", "a_r"})
    fs::copy_file(path("sphere.png"), path(std::string(name) + ".png"));
  Words five{"--from", "faces", "-o", path("o.png")};
  for (const char* name : {"a_right", "a_left", "a_up", "a_down", "a_front"})
    five.push_back(path(std::string(name) + ".png"));
  Words other = five, twice = five;
  other.push_back(path("a_side.png"));
  refused(other, "a_side.png: its name does not end in right, left");
  twice.push_back(path("a_r.png"));
  refused(twice, "are both the face 'right'");
  fs::copy_file(path("sphere.png"), path("a_b.png"));
  Words flat = five;
  flat.push_back(path("a_b.png"));
  refused(flat, "faces are square and alike");
  refused({path("sphere.png"), "--from", "equirectangular", "--layout", "faces", "-o", "-"},
          "six files cannot be sent on");
  EXPECT_FALSE(fs::exists(path("o.png")));
}

TEST_F(Faces, AFileOfTheNameWithoutAFace_IsNotInTheWay) {
  const Refusing refusing;
  write_sphere();
  write("town.png", "something else");
  const Finished run =
      nodal({"convert", path("sphere.png"), "--from", "equirectangular", "--layout", "faces", "-o", path("town.png")});
  EXPECT_EQ(run.code, 0) << run.err;
  EXPECT_EQ(read("town.png"), "something else");
  EXPECT_TRUE(fs::exists(path("town_up.png")));
  const Finished one = nodal({"convert", path("sphere.png"), "--from", "equirectangular", "-o", path("town.png")});
  EXPECT_NE(one.code, 0);
  EXPECT_NE(one.err.find("town.png: is there already"), std::string::npos) << one.err;
}

}  // namespace
}  // namespace nodal::command_line
