// What the numbers of pictures stand for, from every reader through the commands to every writer.
#include <gtest/gtest.h>
#include <lcms2.h>
#include <tiffio.h>
#include <zlib.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>

#include "rig_process.h"
#include "stitch/media/image_file.h"
#include "stitch/media/tiff/tiff_reader.h"
#include "tests/support/pictures.h"

namespace nodal::command_line {
namespace {

using Bytes = std::vector<std::uint8_t>;
constexpr int kWide = 64, kHigh = 32, kPatch = 8;

/// A colour space, as a profile and by its numbers: white, red, green, blue; gamma 0 is sRGB's curve.
struct Space {
  const char* name;
  std::array<double, 8> xy;
  double gamma;
};
constexpr Space kAdobeRgb{"AdobeRGB", {0.3127, 0.3290, 0.64, 0.33, 0.21, 0.71, 0.15, 0.06}, 563.0 / 256};
constexpr Space kDisplayP3{"DisplayP3", {0.3127, 0.3290, 0.680, 0.320, 0.265, 0.690, 0.150, 0.060}, 0};
constexpr Space kSrgbSpace{"sRGB", {0.3127, 0.3290, 0.64, 0.33, 0.30, 0.60, 0.15, 0.06}, 0};
constexpr Space kLinear{"linear", kSrgbSpace.xy, 1};

cmsHPROFILE profile_of(const Space& space) {
  const cmsCIExyY white{space.xy[0], space.xy[1], 1};
  const cmsCIExyYTRIPLE corners{
      {space.xy[2], space.xy[3], 1}, {space.xy[4], space.xy[5], 1}, {space.xy[6], space.xy[7], 1}};
  const std::array<double, 5> srgb{2.4, 1 / 1.055, 0.055 / 1.055, 1 / 12.92, 0.04045};
  cmsToneCurve* const curve =
      space.gamma == 0 ? cmsBuildParametricToneCurve(nullptr, 4, srgb.data()) : cmsBuildGamma(nullptr, space.gamma);
  const std::array<cmsToneCurve*, 3> curves{curve, curve, curve};
  const cmsHPROFILE profile = cmsCreateRGBProfile(&white, &corners, curves.data());
  cmsFreeToneCurve(curve);
  return profile;
}

Bytes icc_of(const Space& space) {
  const cmsHPROFILE profile = profile_of(space);
  cmsUInt32Number length = 0;
  cmsSaveProfileToMem(profile, nullptr, &length);
  Bytes bytes(length);
  cmsSaveProfileToMem(profile, bytes.data(), &length);
  cmsCloseProfile(profile);
  return bytes;
}

/// Patches of 32 colours, RGB, 8 bits.
Bytes chart() {
  Bytes rgb;
  for (int y = 0; y < kHigh; ++y) {
    for (int x = 0; x < kWide; ++x) {
      const int k = x / kPatch + y / kPatch * (kWide / kPatch);
      for (const int level : {50 + 40 * (k % 4), 50 + 40 * (k / 4 % 4), 60 + 90 * (k / 16)}) {
        rgb.push_back(static_cast<std::uint8_t>(level));
      }
    }
  }
  return rgb;
}

/// Little CMS's own conversion in floating point, 0 to 1.
std::vector<double> converted(const Bytes& rgb, const Space& from, const Space& to) {
  const cmsHPROFILE in = profile_of(from), out = profile_of(to);
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

void put_big_endian(std::size_t value, std::uint8_t* to) {
  for (int k = 0; k < 4; ++k) to[k] = static_cast<std::uint8_t>(value >> 8 * (3 - k));
}

/// A PNG with another chunk behind its header.
Bytes with_chunk(Bytes png, const std::string& name, const Bytes& data) {
  Bytes chunk(data.size() + 12);
  put_big_endian(data.size(), chunk.data());
  std::copy(name.begin(), name.end(), chunk.begin() + 4);
  std::copy(data.begin(), data.end(), chunk.begin() + 8);
  put_big_endian(crc32(0, chunk.data() + 4, static_cast<uInt>(data.size() + 4)), chunk.data() + data.size() + 8);
  png.insert(png.begin() + 33, chunk.begin(), chunk.end());
  return png;
}

Bytes with_profile(const Bytes& png, const Bytes& icc) {
  Bytes packed(compressBound(icc.size()));
  uLongf length = packed.size();
  compress(packed.data(), &length, icc.data(), icc.size());
  Bytes data(3 + length);
  data[0] = 'p';
  std::copy_n(packed.begin(), length, data.begin() + 3);
  return with_chunk(png, "iCCP", data);
}

/// Big-endian samples of 16 bits.
Bytes deep_of(const Bytes& rgb) {
  Bytes deep;
  for (const std::uint8_t level : rgb) deep.insert(deep.end(), 2, level);
  return deep;
}

class ColourCommand : public RigTest {
 protected:
  void write_tiff(const std::string& name, const Bytes& samples, int channels, int bits, const Bytes& icc = {},
                  int alpha = -1) const {
    TIFF* tiff = TIFFOpen(path(name).c_str(), "w");
    TIFFSetField(tiff, TIFFTAG_IMAGEWIDTH, kWide);
    TIFFSetField(tiff, TIFFTAG_IMAGELENGTH, kHigh);
    TIFFSetField(tiff, TIFFTAG_SAMPLESPERPIXEL, channels);
    TIFFSetField(tiff, TIFFTAG_BITSPERSAMPLE, bits);
    TIFFSetField(tiff, TIFFTAG_PHOTOMETRIC, PHOTOMETRIC_RGB);
    TIFFSetField(tiff, TIFFTAG_PLANARCONFIG, PLANARCONFIG_CONTIG);
    TIFFSetField(tiff, TIFFTAG_ROWSPERSTRIP, kHigh);
    const auto kind = static_cast<std::uint16_t>(alpha);
    if (alpha >= 0) TIFFSetField(tiff, TIFFTAG_EXTRASAMPLES, 1, &kind);
    if (!icc.empty()) TIFFSetField(tiff, TIFFTAG_ICCPROFILE, static_cast<std::uint32_t>(icc.size()), icc.data());
    Bytes copy = samples;
    TIFFWriteEncodedStrip(tiff, 0, copy.data(), static_cast<tmsize_t>(copy.size()));
    TIFFClose(tiff);
  }

  /// The chart in a space as every kind of file; their names.
  std::vector<std::string> write_chart(const Space& space) const {
    const Bytes rgb = chart(), icc = icc_of(space);
    const std::string name = space.name;
    test::write_bytes(path(name + "8.png"), with_profile(test::png_of(rgb, kWide, kHigh, 3), icc));
    test::write_bytes(path(name + "16.png"), with_profile(test::png_of(deep_of(rgb), kWide, kHigh, 3, 16), icc));
    write_tiff(name + "8.tif", rgb, 3, 8, icc);
    write_tiff(name + "16.tif", deep_of(rgb), 3, 16, icc);
    Bytes jpeg = test::jpeg_of(rgb, kWide, kHigh, test::Sampling::k444, 100);
    Bytes segment{0xFF, 0xE2, static_cast<std::uint8_t>((icc.size() + 16) >> 8),
                  static_cast<std::uint8_t>(icc.size() + 16)};
    for (const char c : std::string("ICC_PROFILE\0\1\1", 14)) segment.push_back(static_cast<std::uint8_t>(c));
    segment.insert(segment.end(), icc.begin(), icc.end());
    jpeg.insert(jpeg.begin() + 2, segment.begin(), segment.end());
    test::write_bytes(path(name + "8.jpg"), jpeg);
    return {name + "8.png", name + "16.png", name + "8.tif", name + "16.tif", name + "8.jpg"};
  }

  /// Samples, 0 to 1, of a picture that Nodal wrote.
  std::vector<double> samples(const std::string& name) const {
    const bool tiff = name.ends_with(".tif");
    const std::string file = path(name);
    const Result<ImageHeader> header = tiff ? media::read_tiff_header(file) : media::read_image_header(file);
    const auto as = header->deep ? header->deep : std::optional(PixelFormat::kRgb24);
    const Result<DecodedImage> image = tiff ? media::read_tiff(file, header->deep) : media::read_image(file, as);
    std::vector<double> levels;
    const Bytes& bytes = image->bytes;
    for (std::size_t k = 0; k < bytes.size() / (header->deep ? 2 : 1); ++k) {
      levels.push_back(header->deep ? (bytes[2 * k] | bytes[2 * k + 1] << 8) / 65535.0 : bytes[k] / 255.0);
    }
    return levels;
  }

  /// Of the middles of patches, where no coding or interpolation mixes two of them.
  static double largest_error(const std::vector<double>& got, const std::vector<double>& right) {
    EXPECT_EQ(got.size(), right.size());
    double worst = 0;
    for (int y = kPatch / 2; y < kHigh; y += kPatch) {
      for (int x = kPatch / 2; x < kWide; x += kPatch) {
        for (int c = 0; c < 3; ++c) {
          const auto at = static_cast<std::size_t>(3 * (y * kWide + x) + c);
          worst = std::max(worst, std::abs(got[at] - right[at]));
        }
      }
    }
    return worst;
  }

  void run(const Words& words) {
    const Finished done = nodal(words);
    ASSERT_EQ(done.code, 0) << done.err;
  }
};

TEST_F(ColourCommand, PicturesWithAProfile_AreConvertedToSrgbByEveryReaderAndWriter) {
  for (const Space& space : {kAdobeRgb, kDisplayP3, kSrgbSpace}) {
    const std::vector<double> right = converted(chart(), space, kSrgbSpace);
    for (const std::string& file : write_chart(space)) {
      for (const std::string& out : {std::string("o.png"), std::string("o.tif"), std::string("o.jpg")}) {
        run({"convert", path(file), "--from", "equirectangular", "-o", path(out), "--quality", "100"});
        const bool coded = file.ends_with(".jpg") || out.ends_with(".jpg");
        const bool deep = file.find("16") != std::string::npos && !coded;
        const double most = deep ? 0.001 : coded ? 3.5 / 255 : 1.5 / 255;
        const double worst = largest_error(samples(out), right);
        EXPECT_LT(worst, most) << file << " to " << out;
        std::printf("%-16s to %-6s largest error %.4f (%.2f of 255)\n", file.c_str(), out.c_str(), worst, 255 * worst);
      }
    }
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
    for (const std::string quality : {"92", "best"}) {
      Words words{"stitch", path("srgb.json")};
      for (int h = 0; h < 6; ++h) words.push_back(path("grey.png"));
      words.insert(words.end(), {"--bits", "16", "--width", "64", "--quality", quality, "-o", path("o.png")});
      run(words);
      const DecodedImage image = media::read_image(path("o.png"), PixelFormat::kRgb48).value();
      EXPECT_TRUE(image.meaning.is_linear());
      for (const double got : samples("o.png")) ASSERT_NEAR(got, light, 0.0006) << level << " " << quality;
      run({"convert", path("o.png"), "-o", path("o.jpg")});
      for (const double got : samples("o.jpg")) ASSERT_NEAR(255 * got, level, 1.5) << quality;
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
  write_tiff("straight.tif", straight, 4, 8, {}, EXTRASAMPLE_UNASSALPHA);
  write_tiff("multiplied.tif", multiplied, 4, 8, {}, EXTRASAMPLE_ASSOCALPHA);
  write_tiff("deep.tif", deep_of(straight), 4, 16, {}, EXTRASAMPLE_UNASSALPHA);
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

TEST_F(ColourCommand, BesideImageMagick_ProfilesGiveTheSameColours) {
  if (Process({"sh", "-c", "command -v convert"}).wait().code != 0) GTEST_SKIP() << "ImageMagick is not installed";
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
