// Pictures that are no whole sphere, given to `nodal convert` and `nodal view`.
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "rig_process.h"
#include "stitch/media/image_file.h"
#include "tests/support/pictures.h"

namespace nodal::command_line {
namespace {

class SpherePart : public RigTest {
 protected:
  SpherePart() { test::write_bytes(path("s.png"), test::png_of(std::vector<std::uint8_t>(64 * 32, 200), 64, 32, 1)); }
};

TEST_F(SpherePart, ByItsMetadata_IsPlacedOnTheSphere) {
  ASSERT_EQ(nodal({"convert", path("s.png"), "--from", "equirectangular", "-o", path("s.jpg")}).code, 0);
  // The middle of a sphere of 80x40 px.
  std::string jpeg = read("s.jpg");
  for (const auto& [what, other] : {std::pair("FullPanoWidthPixels=\"64", "FullPanoWidthPixels=\"80"),
                                    {"FullPanoHeightPixels=\"32", "FullPanoHeightPixels=\"40"},
                                    {"CroppedAreaLeftPixels=\"0", "CroppedAreaLeftPixels=\"8"},
                                    {"CroppedAreaTopPixels=\"0", "CroppedAreaTopPixels=\"4"}}) {
    ASSERT_NE(jpeg.find(what), std::string::npos) << what;
    jpeg.replace(jpeg.find(what), std::string(what).size(), other);
  }
  write("part.jpg", jpeg);
  const Finished run = nodal({"convert", path("part.jpg"), "-o", path("whole.png"), "--filter", "nearest"});
  ASSERT_EQ(run.code, 0) << run.err;
  EXPECT_EQ(run.err, "");
  const DecodedImage whole = media::read_image(path("whole.png"), PixelFormat::kGrey8).value();
  ASSERT_EQ(whole.width, 80);
  ASSERT_EQ(whole.height, 40);
  for (int y = 0; y < 40; ++y) {
    for (int x = 0; x < 80; ++x) {
      const bool present = x >= 8 && x < 72 && y >= 4 && y < 36;
      EXPECT_NEAR(whole.bytes[static_cast<std::size_t>(80 * y + x)], present ? 200 : 0, 2) << x << " " << y;
    }
  }
  // What --from says is said of the picture as it is.
  const Json plain = nodal_json({"convert", path("part.jpg"), "--from", "equirectangular", "-o", path("w.png")}).at(0);
  EXPECT_EQ(plain["width"], 64);
  jpeg.replace(jpeg.find("TopPixels=\"4"), 12, "TopPixels=\"9");
  jpeg.replace(jpeg.find("HeightPixels=\"40"), 16, "HeightPixels=\"38");
  write("wrong.jpg", jpeg);
  const Finished wrong = nodal({"view", path("wrong.jpg"), "-o", path("v.png")});
  EXPECT_NE(wrong.code, 0);
  EXPECT_NE(wrong.err.find("wrong.jpg: its metadata says that it shows 64x32 px from 8, 9 on of a sphere of 80x38"),
            std::string::npos)
      << wrong.err;
}

TEST_F(SpherePart, APictureOfAnotherShapeThanItsLayout_IsConvertedWithAWarning) {
  const auto said = [&](const std::string& from) {
    const Finished run = nodal({"view", path("s.png"), "--from", from, "-o", path("v.png"), "--size", "8x8"});
    EXPECT_EQ(run.code, 0) << run.err;
    return run.err;
  };
  EXPECT_NE(said("mercator")
                .find("s.png: it has 64x32 pixels, and the whole sphere (mercator) with this "
                      "width has 64x64: what it shows is stretched 2.0 times"),
            std::string::npos);
  EXPECT_EQ(said("equirectangular"), "");
  EXPECT_EQ(said("halton"), "") << "any shape does for scattered rays";
}

TEST_F(SpherePart, AnUnknownEnding_IsToldTheKnownOnes) {
  const Finished run = nodal({"view", path("s.png"), "--from", "cube", "-o", path("v.bmp")});
  EXPECT_NE(run.err.find("v.bmp': end it in .jpg, .png, .tif or .raw\n"), std::string::npos) << run.err;
  EXPECT_EQ(run.err.find("--format"), std::string::npos) << "which `view` does not have";
}

}  // namespace
}  // namespace nodal::command_line
