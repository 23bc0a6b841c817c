// `nodal view --path`: a camera that moves from picture to picture.
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <string>
#include <vector>

#include "rig_process.h"
#include "stitch/media/image_file.h"
#include "tests/support/pictures.h"

namespace nodal::command_line {
namespace {

class CameraPathCommand : public RigTest {
 protected:
  void expect_refused(const Words& words, const std::string& says) const {
    const Finished run = nodal(words);
    EXPECT_NE(run.code, 0) << says;
    EXPECT_NE(run.err.find(says), std::string::npos) << run.err;
  }
  std::vector<std::uint8_t> picture(const std::string& name) const {
    return media::read_image(path(name), PixelFormat::kGrey8).value().bytes;
  }
};

TEST_F(CameraPathCommand, MovesTheCamera_AndItsKeysAreTheViewsThere) {
  std::vector<std::uint8_t> levels;
  for (int p = 0; p < 256 * 128; ++p) {
    const double theta = 6.2831853 * (p % 256 + 0.5) / 256, phi = 3.1415927 * (p / 256 + 0.5) / 128;
    levels.push_back(static_cast<std::uint8_t>(128 + 100 * std::sin(phi) * std::sin(5 * theta) * std::cos(3 * phi)));
  }
  test::write_bytes(path("sphere.png"), test::png_of(levels, 256, 128, 1));
  write("turn.csv", "picture,yaw,pitch,roll,fov\n0,0,0,0,90\n4,60,-20,5,60\n6,60,0,0,120\n");
  const Words common{"view", path("sphere.png"), "--from", "equirectangular", "--size", "64x48"};
  const auto run = [&](const Words& more) {
    Words words = common;
    words.insert(words.end(), more.begin(), more.end());
    return nodal(words);
  };
  const Finished moved = run({"--path", path("turn.csv"), "-o", path("v-%d.png")});
  ASSERT_EQ(moved.code, 0) << moved.err;
  EXPECT_TRUE(std::filesystem::exists(path("v-6.png")));
  EXPECT_FALSE(std::filesystem::exists(path("v-7.png")));
  ASSERT_EQ(run({"--yaw", "60", "--pitch", "-20", "--roll", "5", "--fov", "60", "-o", path("still.png")}).code, 0);
  EXPECT_EQ(picture("still.png"), picture("v-4.png"));
  EXPECT_NE(picture("still.png"), picture("v-3.png"));
  // To a pipe: seven JPEGs, which begin with these bytes.
  const Finished piped = run({"--path", path("turn.csv"), "-o", "-"});
  ASSERT_EQ(piped.code, 0) << piped.err;
  std::size_t jpegs = 0;
  for (std::size_t at = 0; (at = piped.out.find("\xff\xd8\xff", at)) != std::string::npos; ++at) ++jpegs;
  EXPECT_EQ(jpegs, 7U);
  // Several raymaps give one view each.
  const Finished several = nodal({"view", path("sphere.png"), path("sphere.png"), "--from", "equirectangular", "--size",
                                  "64x48", "--path", path("turn.csv"), "-o", path("s-%d.png")});
  ASSERT_EQ(several.code, 0) << several.err;
  EXPECT_TRUE(std::filesystem::exists(path("s-1.png")));
  EXPECT_FALSE(std::filesystem::exists(path("s-2.png")));
  const auto refused = [&](const Words& more, const std::string& says) {
    Words words = common;
    words.insert(words.end(), more.begin(), more.end());
    expect_refused(words, says);
  };
  refused({"--path", path("turn.csv"), "-o", path("one.png")}, "there will be 7 pictures");
  std::filesystem::copy_file(path("sphere.png"), path("s-3.png"));  // the fourth picture would be written over it
  expect_refused(
      {"view", path("s-3.png"), "--from", "equirectangular", "--path", path("turn.csv"), "-o", path("s-%d.png")},
      "s-3.png is one of the pictures");
  refused({"--path", path("turn.csv"), "-o", "-", "--json"}, "both want standard output");
  refused({"--path", path("turn.csv"), "--yaw", "3", "-o", path("v-%d.png")}, "excludes --path");
  refused({"--path", path("none.csv"), "-o", path("v-%d.png")}, "no such file");
  write("wide.csv", "0,0,0,0,90\n9,0,0,0,200\n");
  refused({"--path", path("wide.csv"), "-o", path("v-%d.png")}, "picture 9: a field of view of 200 degrees");
  write("torn.csv", "0,0,0,0,90\n9,0,0\n");
  refused({"--path", path("torn.csv"), "-o", path("v-%d.png")}, "torn.csv: line 2: write picture,yaw");
}

}  // namespace
}  // namespace nodal::command_line
