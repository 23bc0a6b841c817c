// `nodal stitch --crop`: panoramas that are no whole spheres.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <regex>

#include "stitch/media/image_file.h"
#include "stitch_command.h"

namespace nodal::command_line {
namespace {

class CropCommand : public StitchCommand {
 protected:
  /// The first head alone: it looks forward, and its circle is 130 degrees wide.
  void write_one_head() {
    write_pictures("pictures");
    Calibration one = town().truth;
    one.heads.resize(1);
    one.heads[0].region.circle = Region::Circle{kSide / 2.0, kSide / 2.0, kSide / 2.0};
    write("one.json", to_json(one));
  }
  Json stitched(const std::string& out, const Words& more) {
    Words words{"stitch", path("one.json"), path("pictures/" + name_of(0) + ".png"), "-o", path(out)};
    words.insert(words.end(), more.begin(), more.end());
    return nodal_json(words).at(0);
  }
  int said(const std::string& file, const std::string& property) const {
    std::smatch found;
    const std::string text = read(file);
    if (!std::regex_search(text, found, std::regex("GPano:" + property + "=\"([0-9]+)\""))) return -1;
    return std::stoi(found[1]);
  }
  DecodedImage image(const std::string& file) const {
    return media::read_image(path(file), PixelFormat::kRgb24).value();
  }
};

bool is_black(const DecodedImage& picture, int x, int y) {
  const auto at = picture.bytes.begin() + 3 * (std::ptrdiff_t{y} * picture.width + x);
  return std::all_of(at, at + 3, [](std::uint8_t level) { return level == 0; });
}

TEST_F(CropCommand, APanorama_IsCroppedToWhatIsSeenAndSaysWhereItIs) {
  write_one_head();
  const Json whole = stitched("whole.png", {"--crop", "none", "--width", "720"});
  const Json part = stitched("part.jpg", {"--width", "720"});
  ASSERT_EQ(whole["width"], 720);
  // The share of a cap of 65 degrees: (1 - cos 65) / 2.
  EXPECT_NEAR(part["share"].get<double>(), 0.2887, 0.003);
  EXPECT_EQ(part["crop"]["full_width"], 720);
  // Two pixels a degree: the cap is -65 .. 65 degrees wide and high.
  EXPECT_NEAR(part["crop"]["left"].get<int>(), 230, 1);
  EXPECT_NEAR(part["crop"]["top"].get<int>(), 50, 1);
  EXPECT_NEAR(part["width"].get<int>(), 260, 2);
  EXPECT_NEAR(part["height"].get<int>(), 260, 2);
  for (const auto& [property, value] :
       std::vector<std::pair<std::string, Json>>{{"FullPanoWidthPixels", 720},
                                                 {"FullPanoHeightPixels", 360},
                                                 {"CroppedAreaLeftPixels", part["crop"]["left"]},
                                                 {"CroppedAreaTopPixels", part["crop"]["top"]},
                                                 {"CroppedAreaImageWidthPixels", part["width"]},
                                                 {"CroppedAreaImageHeightPixels", part["height"]}})
    EXPECT_EQ(said("part.jpg", property), value.get<int>()) << property;
  // Nothing that is seen is outside, and the sphere comes back.
  ASSERT_EQ(nodal({"stitch", path("one.json"), path("pictures/" + name_of(0) + ".png"), "--width", "720", "-o",
                   path("part.png")})
                .code,
            0);
  ASSERT_EQ(nodal({"convert", path("part.png"), "--width", "720", "-o", path("back.png")}).code, 0);
  EXPECT_GT(test::psnr(image("back.png").bytes, image("whole.png").bytes), 45);
  const DecodedImage all = image("whole.png");
  const int left = part["crop"]["left"], top = part["crop"]["top"], wide = part["width"], high = part["height"];
  int outside = 0;
  for (int y = 0; y < all.height; ++y)
    for (int x = 0; x < all.width; ++x)
      if (x < left || y < top || x >= left + wide || y >= top + high) outside += is_black(all, x, y) ? 0 : 1;
  EXPECT_EQ(outside, 0);
}

TEST_F(CropCommand, AnyPart_IsThatOfTheWholeAlsoWithSixteenBits) {
  write_one_head();
  stitched("whole.png", {"--crop", "none", "--width", "400"});
  const Json part = stitched("part.png", {"--crop", "101,33,155,77", "--width", "400"});
  EXPECT_EQ(part["width"], 155);
  const DecodedImage all = image("whole.png"), some = image("part.png");
  ASSERT_EQ(some.height, 77);
  std::vector<std::uint8_t> expected;
  for (int y = 33; y < 33 + 77; ++y) {
    const auto row = all.bytes.begin() + 3 * (std::ptrdiff_t{y} * all.width + 101);
    expected.insert(expected.end(), row, row + 3 * 155);
  }
  EXPECT_EQ(some.bytes, expected);
  EXPECT_EQ(stitched("deep.png", {"--crop", "101,33,155,77", "--width", "400", "--bits", "16"})["height"], 77);
  for (const char* nonsense :
       {"", "1,2,3", "-1,0,10,10", "0,0,0,0", "nan,0,1,1", "0,0,99999,10", "1,2,3,4,5", "0,0,1e3,9"})
    expect_refused(
        {path("one.json"), path("pictures/" + name_of(0) + ".png"), "--crop", nonsense, "-o", path("no.png")},
        "--crop");
  expect_refused(
      {path("one.json"), path("pictures/" + name_of(0) + ".png"), "--crop", "0,0,99999,10", "-o", path("no.png")},
      "at most 32768 pixels a side");
  for (const Words& outside : {Words{"--width", "400", "--crop", "300,0,101,50"},
                               {"--width", "400", "--crop", "0,150,50,51"},
                               {"--layout", "cube", "--crop", "0,0,50,50"}}) {
    Words words{path("one.json"), path("pictures/" + name_of(0) + ".png"), "-o", path("no.png")};
    words.insert(words.end(), outside.begin(), outside.end());
    expect_refused(words, "--crop");
  }
}

TEST_F(CropCommand, AWholeSphere_IsNotCropped) {
  write_pictures("pictures");
  const Json answer = nodal_json({"stitch", path("rig.json"), path("pictures"), "-o", path("sphere.jpg")}).at(0);
  EXPECT_FALSE(answer.contains("crop"));
  EXPECT_NEAR(answer["share"].get<double>(), 1, 1e-6);
  EXPECT_EQ(said("sphere.jpg", "CroppedAreaImageWidthPixels"), answer["width"].get<int>());
}

TEST_F(CropCommand, AVeryFinePicture_IsNoWiderThanOtherProgramsOpen) {
  write_one_head();
  Calibration fine = parse_calibration(read("one.json")).value();
  HeadCalibration& head = fine.heads[0];  // a tele lens: 3.5 degrees over 160 px, 16336 px for the whole circle
  head.lens = EquidistantLens{{2600}};
  head.max_angle = 0;
  write("one.json", to_json(fine));
  const Json part = stitched("tele.jpg", {"--blend", "rig"});
  EXPECT_NEAR(part["crop"]["full_width"].get<int>(), 16336, 4);
  EXPECT_NEAR(part["width"].get<int>(), 160, 2);
  const Json whole = stitched("whole.jpg", {"--blend", "rig", "--crop", "none"});
  EXPECT_EQ(whole["width"], 16000);
}

}  // namespace
}  // namespace nodal::command_line
