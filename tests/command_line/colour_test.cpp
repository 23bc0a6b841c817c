// What the numbers of pictures stand for, from every reader through the commands to every writer.
#include <gtest/gtest.h>
#include <lcms2.h>
#include <tiff.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>

#include "colour_chart.h"
#include "rig_process.h"
#include "stitch/media/image_file.h"
#include "stitch/media/tiff/tiff_reader.h"
#include "tests/support/pictures.h"

namespace nodal::command_line {
namespace {

/// Little CMS's own conversion in floating point, 0 to 1.
std::vector<double> converted(const Bytes& rgb, const Space& from, const Space& to) {
  const auto opened = [](const Bytes& icc) {
    return cmsOpenProfileFromMem(icc.data(), static_cast<cmsUInt32Number>(icc.size()));
  };
  const cmsHPROFILE in = opened(icc_of(from)), out = opened(icc_of(to));
  const cmsHTRANSFORM transform =
      cmsCreateTransform(in, TYPE_RGB_DBL, out, TYPE_RGB_DBL, INTENT_RELATIVE_COLORIMETRIC, cmsFLAGS_NOOPTIMIZE);
  std::vector<double> levels;
  for (const std::uint8_t level : rgb) levels.push_back(level / 255.0);
  cmsDoTransform(transform, levels.data(), levels.data(), static_cast<cmsUInt32Number>(levels.size() / 3));
  cmsDeleteTransform(transform);
  cmsCloseProfile(in);
  cmsCloseProfile(out);
  for (double& level : levels) level = std::clamp(level, 0.0, 1.0);
  return levels;
}

TEST(Chart, ItsDefinition_AgreesWithLittleCms) {
  const std::vector<double> levels = levels_of(chart());
  for (const Space& space : {kAdobeRgb, kDisplayP3, kSrgbSpace, kLinear}) {
    const std::vector<double> defined = by_definition(levels, space, kSrgbSpace);
    const std::vector<double> peer = converted(chart(), space, kSrgbSpace);
    double worst = 0;
    for (std::size_t k = 0; k < peer.size(); ++k) worst = std::max(worst, std::abs(defined[k] - peer[k]));
    EXPECT_LT(worst, 0.001) << space.name;
    std::printf("%-10s the definition beside Little CMS: largest difference %.5f\n", space.name, worst);
  }
}

TEST_F(ColourCommand, AHeadsPictureWithAProfile_IsStitchedInSrgb) {
  const Bytes rgb = [] {
    Bytes all;
    for (int k = 0; k < 96 * 96; ++k) all.insert(all.end(), {60, 200, 60});
    return all;
  }();
  test::write_bytes(path("wide.png"), with_profile(test::png_of(rgb, 96, 96, 3), icc_of(kAdobeRgb)));
  Words words{"stitch", path("six.json")};
  for (int h = 0; h < 6; ++h) words.push_back(path("wide.png"));
  words.insert(words.end(), {"-o", path("o.png"), "--width", "64"});
  run(words);
  const std::vector<double> right = converted({60, 200, 60}, kAdobeRgb, kSrgbSpace);
  const std::vector<double> got = samples("o.png");
  for (std::size_t k = 0; k < got.size(); ++k) ASSERT_NEAR(got[k], right[k % 3], 2.0 / 255) << k;
}

/// 16 bits, gAMA 1, as Nodal and other programs write linear light: the light of sRGB 128 everywhere.
Bytes linear_png() {
  constexpr unsigned kLight = 14147;  // 65535 * 0.21586, IEC 61966-2-1
  Bytes samples;
  for (int k = 0; k < kWide * kHigh * 3; ++k) samples.insert(samples.end(), {kLight >> 8, kLight & 255});
  return with_chunk(test::png_of(samples, kWide, kHigh, 3, 16), "gAMA", {0, 1, 0x86, 0xA0});
}

TEST_F(ColourCommand, LinearNumbers_StayLinearOrAreShownRight) {
  test::write_bytes(path("linear.png"), linear_png());
  run({"convert", path("linear.png"), "--from", "equirectangular", "-o", path("o.jpg")});
  for (const double level : samples("o.jpg")) ASSERT_NEAR(255 * level, 128, 1.01);
  run({"view", path("linear.png"), "--from", "equirectangular", "-o", path("v.jpg"), "--size", "32x32"});
  for (const double level : samples("v.jpg")) ASSERT_NEAR(255 * level, 128, 1.01);
  // From PNG to PNG, to TIFF and back.
  run({"convert", path("linear.png"), "--from", "equirectangular", "--layout", "cube", "-o", path("cube.png")});
  run({"convert", path("linear.png"), "--from", "equirectangular", "-o", path("o.tif")});
  run({"convert", path("o.tif"), "-o", path("back.png")});
  for (const std::string file : {"cube.png", "back.png"}) {
    const DecodedImage image = media::read_image(path(file), PixelFormat::kRgb48).value();
    EXPECT_TRUE(image.meaning.is_linear()) << file;
    EXPECT_NE(read(file).find("Numbers are proportional to light."), std::string::npos) << file;
  }
  for (const double level : samples("back.png")) ASSERT_NEAR(65535 * level, 14147, 2);
  run({"convert", path("o.tif"), "-o", path("t.jpg")});
  for (const double level : samples("t.jpg")) ASSERT_NEAR(255 * level, 128, 1.01);
  // Other programs read the TIFF's profile.
  const DecodedImage tiff = media::read_tiff(path("o.tif"), PixelFormat::kRgb48).value();
  ASSERT_FALSE(tiff.meaning.icc.empty());
  const cmsHPROFILE profile =
      cmsOpenProfileFromMem(tiff.meaning.icc.data(), static_cast<cmsUInt32Number>(tiff.meaning.icc.size()));
  ASSERT_NE(profile, nullptr);
  EXPECT_NE(cmsIsToneCurveLinear(static_cast<const cmsToneCurve*>(cmsReadTag(profile, cmsSigGreenTRCTag))), 0);
  cmsCloseProfile(profile);
}

TEST_F(ColourCommand, SixteenBitsOfHeadsWithSrgb_AreProportionalToLight) {
  Calibration rig = six_heads("srgb");
  for (HeadCalibration& head : rig.heads) head.response.curve = Response::Curve::kSrgb;
  write("srgb.json", to_json(rig));
  for (const auto& [level, light] : {std::pair(64, 0.05126945), {128, 0.21586050}}) {  // IEC 61966-2-1
    test::write_bytes(path("grey.png"), test::png_of(Bytes(96 * 96, static_cast<std::uint8_t>(level)), 96, 96, 1));
    for (const std::string blend : {"rig", "best"}) {
      Words words{"stitch", path("srgb.json")};
      for (int h = 0; h < 6; ++h) words.push_back(path("grey.png"));
      words.insert(words.end(), {"--bits", "16", "--width", "64", "--blend", blend, "-o", path("o.png")});
      run(words);
      const DecodedImage image = media::read_image(path("o.png"), PixelFormat::kRgb48).value();
      EXPECT_TRUE(image.meaning.is_linear());
      for (const double got : samples("o.png")) ASSERT_NEAR(got, light, 0.0006) << level << " " << blend;
      run({"convert", path("o.png"), "-o", path("o.jpg")});
      for (const double got : samples("o.jpg")) ASSERT_NEAR(255 * got, level, 1.5) << blend;
    }
  }
}

TEST_F(ColourCommand, Alpha_MeansTheSameInEveryFile) {
  Bytes straight, multiplied;
  for (int k = 0; k < kWide * kHigh; ++k) {
    straight.insert(straight.end(), {200, 100, 50, 128});
    multiplied.insert(multiplied.end(), {100, 50, 25, 128});
  }
  test::write_bytes(path("a.png"), test::png_of(straight, kWide, kHigh, 4));
  write_tiff(path("straight.tif"), straight, {.channels = 4, .alpha = EXTRASAMPLE_UNASSALPHA});
  write_tiff(path("multiplied.tif"), multiplied, {.channels = 4, .alpha = EXTRASAMPLE_ASSOCALPHA});
  write_tiff(path("deep.tif"), deep_of(straight), {.channels = 4, .bits = 16, .alpha = EXTRASAMPLE_UNASSALPHA});
  for (const std::string file : {"a.png", "straight.tif", "multiplied.tif", "deep.tif"}) {
    const Finished done = nodal({"convert", path(file), "--from", "equirectangular", "-o", path("o.png")});
    ASSERT_EQ(done.code, 0) << done.err;
    EXPECT_NE(done.err.find(file + " has an alpha channel, which is left out"), std::string::npos) << done.err;
    const std::vector<double> got = samples("o.png");
    for (std::size_t k = 0; k < got.size(); ++k) {
      ASSERT_NEAR(255 * got[k], (std::array{200, 100, 50}[k % 3]), 1.01) << file;
    }
  }
}

TEST_F(ColourCommand, AdobeRgbByExifAlone_IsConvertedToo) {
  if (Process({"sh", "-c", "command -v exiftool"}).wait().code != 0) GTEST_SKIP() << "exiftool is not installed";
  // As cameras that are set to Adobe RGB write it: no profile.
  test::write_bytes(path("r03.jpg"), test::jpeg_of(chart(), kWide, kHigh, test::Sampling::k444, 100));
  const Finished tagged = Process({"exiftool", "-q", "-overwrite_original", "-ExifIFD:ColorSpace=65535",
                                   "-InteropIFD:InteropIndex=R03", path("r03.jpg")})
                              .wait();
  ASSERT_EQ(tagged.code, 0) << tagged.err;
  run({"convert", path("r03.jpg"), "--from", "equirectangular", "-o", path("o.png")});
  EXPECT_LT(largest_error(samples("o.png"), converted(chart(), kAdobeRgb, kSrgbSpace)), 3.5 / 255);
}

TEST_F(ColourCommand, CodePointsOfAPng_AreAppliedOrRefused) {
  const Bytes plain = test::png_of(chart(), kWide, kHigh, 3);
  test::write_bytes(path("p3.png"), with_chunk(plain, "cICP", {12, 13, 0, 1}));  // Display P3 by H.273
  run({"convert", path("p3.png"), "--from", "equirectangular", "-o", path("o.png")});
  EXPECT_LT(largest_error(samples("o.png"), converted(chart(), kDisplayP3, kSrgbSpace)), 1.5 / 255);
  test::write_bytes(path("hdr.png"), with_chunk(plain, "cICP", {9, 16, 0, 1}));
  const Finished done = nodal({"convert", path("hdr.png"), "--from", "equirectangular", "-o", path("o.png")});
  EXPECT_NE(done.code, 0);
  EXPECT_NE(done.err.find("hdr.png': its colours are given by PQ (HDR)"), std::string::npos) << done.err;
}

TEST_F(ColourCommand, HeadsWhoseResponseIsLinear_TakeLinearFilesAsTheyAre) {
  // 16 bits, gAMA 1, a quarter of the light.
  Bytes quarter;
  for (int k = 0; k < 96 * 96; ++k) quarter.insert(quarter.end(), {0x40, 0x00});
  test::write_bytes(path("linear.png"), with_chunk(test::png_of(quarter, 96, 96, 1, 16), "gAMA", {0, 1, 0x86, 0xA0}));
  for (const bool linear : {true, false}) {
    Calibration rig = six_heads("rig");
    for (HeadCalibration& head : rig.heads) {
      head.response.curve = linear ? Response::Curve::kLinear : Response::Curve::kSrgb;
    }
    write("rig.json", to_json(rig));
    Words words{"stitch", path("rig.json")};
    for (int h = 0; h < 6; ++h) words.push_back(path("linear.png"));
    words.insert(words.end(), {"--bits", "16", "--width", "64", "-o", path("o.png")});
    run(words);
    for (const double got : samples("o.png")) ASSERT_NEAR(got, 0.25, 0.004) << linear;
  }
}

// A rig registered by its data sheet has a linear response for want of another one, and photographs are sRGB.
TEST_F(ColourCommand, SixteenBitsOfFilesThatAreNotCalledLinear_AreNoted) {
  for (const bool says : {false, true}) {
    const Bytes grey(96 * 96 * 2, 0x40);
    const Bytes png = test::png_of(grey, 96, 96, 1, 16);
    test::write_bytes(path("grey.png"), says ? with_chunk(png, "gAMA", {0, 1, 0x86, 0xA0}) : png);
    Words words{"stitch", path("six.json")};
    for (int h = 0; h < 6; ++h) words.push_back(path("grey.png"));
    words.insert(words.end(), {"--bits", "16", "--width", "64", "-o", path("o.png")});
    const Finished done = nodal(words);
    ASSERT_EQ(done.code, 0) << done.err;
    const bool noted = done.err.find("the numbers of head 'cam0' are proportional to light, and ") != std::string::npos;
    EXPECT_EQ(noted, !says) << done.err;
  }
}

TEST_F(ColourCommand, BesideImageMagick_ProfilesGiveTheSameColours) {
  if (Process({"sh", "-c", "convert -version | grep -q '^Version: ImageMagick'"}).wait().code != 0)
    GTEST_SKIP() << "ImageMagick is not installed";
  test::write_bytes(path("srgb.icc"), icc_of(kSrgbSpace));
  for (const Space& space : {kAdobeRgb, kDisplayP3, kLinear}) {
    for (const std::string& file : write_chart(space)) {
      run({"convert", path(file), "--from", "equirectangular", "-o", path("ours.jpg"), "--quality", "100"});
      const Finished peer = Process({"convert", path(file), "-intent", "relative", "-profile", path("srgb.icc"),
                                     "-depth", "8", "-strip", path("theirs.png")})
                                .wait();
      ASSERT_EQ(peer.code, 0) << peer.err;
      const double worst = largest_error(samples("ours.jpg"), samples("theirs.png"));
      EXPECT_LT(worst, 3.5 / 255) << file;
      std::printf("%-16s beside ImageMagick: largest difference %.2f of 255\n", file.c_str(), 255 * worst);
    }
  }
}

}  // namespace
}  // namespace nodal::command_line
