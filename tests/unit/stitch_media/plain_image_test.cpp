// Pictures for programs without colour management.
#include "stitch/media/plain_image.h"

#include <gtest/gtest.h>
#include <lcms2.h>

#include <array>
#include <string>
#include <vector>

#include "stitch/media/srgb_profile.h"
#include "tests/support/pictures.h"

namespace nodal::media {
namespace {

using Icc = std::vector<std::uint8_t>;
using Corners = std::array<double, 8>;  // x, y of white, red, green, blue
constexpr Corners kSrgb{0.3127, 0.3290, 0.64, 0.33, 0.30, 0.60, 0.15, 0.06};
constexpr Corners kAdobe{0.3127, 0.3290, 0.64, 0.33, 0.21, 0.71, 0.15, 0.06};
constexpr Corners kP3{0.3127, 0.3290, 0.680, 0.320, 0.265, 0.690, 0.150, 0.060};

cmsToneCurve* srgb_curve() {
  const std::array<double, 5> numbers{2.4, 1 / 1.055, 0.055 / 1.055, 1 / 12.92, 0.04045};
  return cmsBuildParametricToneCurve(nullptr, 4, numbers.data());
}

/// The same curve as a table, as profiles of version 2 have it.
cmsToneCurve* tabled(cmsToneCurve* curve, int entries) {
  std::vector<cmsUInt16Number> table;
  for (int k = 0; k < entries; ++k) {
    table.push_back(static_cast<cmsUInt16Number>(
        65535 * cmsEvalToneCurveFloat(curve, static_cast<float>(k) / static_cast<float>(entries - 1)) + 0.5F));
  }
  cmsFreeToneCurve(curve);
  return cmsBuildTabulatedToneCurve16(nullptr, static_cast<cmsUInt32Number>(entries), table.data());
}

Icc icc_of(const Corners& xy, cmsToneCurve* curve, bool grey = false, double version = 4.3) {
  const cmsCIExyY white{xy[0], xy[1], 1};
  const cmsCIExyYTRIPLE corners{{xy[2], xy[3], 1}, {xy[4], xy[5], 1}, {xy[6], xy[7], 1}};
  const std::array<cmsToneCurve*, 3> curves{curve, curve, curve};
  const cmsHPROFILE profile =
      grey ? cmsCreateGrayProfile(cmsD50_xyY(), curve) : cmsCreateRGBProfile(&white, &corners, curves.data());
  cmsSetProfileVersion(profile, version);
  cmsUInt32Number length = 0;
  cmsSaveProfileToMem(profile, nullptr, &length);
  Icc bytes(length);
  cmsSaveProfileToMem(profile, bytes.data(), &length);
  cmsCloseProfile(profile);
  cmsFreeToneCurve(curve);
  return bytes;
}

TEST(SrgbProfile, OfSrgbInEveryForm_IsKnown) {
  EXPECT_TRUE(is_srgb_profile(icc_of(kSrgb, srgb_curve())));
  EXPECT_TRUE(is_srgb_profile(icc_of(kSrgb, tabled(srgb_curve(), 1024), false, 2.1)));
  EXPECT_TRUE(is_srgb_profile(icc_of(kSrgb, tabled(srgb_curve(), 256), false, 2.1)));
  EXPECT_TRUE(is_srgb_profile(icc_of(kSrgb, srgb_curve(), true)));
  const cmsHPROFILE own = cmsCreate_sRGBProfile();
  cmsUInt32Number length = 0;
  cmsSaveProfileToMem(own, nullptr, &length);
  Icc bytes(length);
  cmsSaveProfileToMem(own, bytes.data(), &length);
  cmsCloseProfile(own);
  EXPECT_TRUE(is_srgb_profile(bytes));
}

TEST(SrgbProfile, OfOtherSpaces_IsNot) {
  EXPECT_FALSE(is_srgb_profile(icc_of(kP3, srgb_curve())));
  EXPECT_FALSE(is_srgb_profile(icc_of(kAdobe, cmsBuildGamma(nullptr, 563.0 / 256))));
  for (const double gamma : {1.0, 1.8, 2.2}) {
    EXPECT_FALSE(is_srgb_profile(icc_of(kSrgb, cmsBuildGamma(nullptr, gamma)))) << gamma;
    EXPECT_FALSE(is_srgb_profile(icc_of(kSrgb, cmsBuildGamma(nullptr, gamma), true))) << gamma;
    EXPECT_FALSE(is_srgb_profile(icc_of(kSrgb, tabled(cmsBuildGamma(nullptr, gamma), 1024), false, 2.1))) << gamma;
  }
  // White at D50, as in photographs for print.
  EXPECT_FALSE(is_srgb_profile(icc_of({0.3457, 0.3585, 0.7347, 0.2653, 0.1596, 0.8404, 0.0366, 0.0001}, srgb_curve())));
}

TEST(SrgbProfile, CutAnywhere_IsNot) {
  for (const Icc& whole : {icc_of(kSrgb, srgb_curve()), icc_of(kSrgb, tabled(srgb_curve(), 256), false, 2.1)}) {
    for (std::size_t length = 0; length + 64 < whole.size(); ++length) {
      EXPECT_FALSE(is_srgb_profile(std::span(whole).first(length))) << length;
    }
  }
}

/// Exif of one byte order: ColorSpace, and the Interoperability index if there is one.
std::vector<std::uint8_t> exif(bool little, unsigned space, const std::string& index) {
  std::vector<std::uint8_t> block{little ? std::uint8_t{'I'} : std::uint8_t{'M'}};
  block.push_back(block[0]);
  const auto put = [&](unsigned value, int bytes) {
    for (int k = 0; k < bytes; ++k)
      block.push_back(static_cast<std::uint8_t>(value >> 8 * (little ? k : bytes - 1 - k)));
  };
  const auto entry = [&](unsigned tag, unsigned type, unsigned count) {
    put(tag, 2);
    put(type, 2);
    put(count, 4);
  };
  put(42, 2);
  put(8, 4);
  put(1, 2);  // the first directory, at 8: a link to Exif's
  entry(34665, 4, 1);
  put(26, 4);
  put(0, 4);
  put(2, 2);  // at 26
  entry(40961, 3, 1);
  put(space, 2);
  put(0, 2);
  entry(40965, 4, 1);
  put(56, 4);
  put(0, 4);
  put(1, 2);  // at 56
  entry(1, 2, 4);
  for (const char c : index) block.push_back(static_cast<std::uint8_t>(c));
  put(0, 4);
  return block;
}

std::string refusal(ImageHeader header) {
  const Status plain = check_plain(header, "p.jpg");
  return plain ? "" : plain.error().message;
}

TEST(CheckPlain, EachWordForOtherColours_IsNamedWithItsRemoval) {
  ImageHeader header{4, 4};
  EXPECT_EQ(refusal(header), "");
  header.meaning = SampleMeaning::srgb();
  EXPECT_EQ(refusal(header), "");
  header.meaning.icc = icc_of(kSrgb, srgb_curve());
  EXPECT_EQ(refusal(header), "");
  header.meaning.icc = icc_of(kP3, srgb_curve());
  EXPECT_NE(refusal(header).find("'p.jpg': is not in sRGB, as its colour profile says"), std::string::npos);
  EXPECT_NE(refusal(header).find("exiftool -icc_profile= FILE"), std::string::npos);
  header.meaning = SampleMeaning::linear();
  EXPECT_NE(refusal(header).find("its cICP, gAMA or cHRM chunk"), std::string::npos);
  header.meaning = {.unread = "PQ (HDR)"};
  EXPECT_NE(refusal(header).find("its cICP, gAMA or cHRM chunk"), std::string::npos);
  header.meaning = {.curve = SampleMeaning::Curve::kSrgb, .primaries = kP3};
  EXPECT_NE(refusal(header).find("its cICP, gAMA or cHRM chunk"), std::string::npos);
}

TEST(CheckPlain, AdobeRgbByExif_IsRefusedInBothByteOrders) {
  for (const bool little : {false, true}) {
    ImageHeader header{4, 4};
    header.metadata.exif = exif(little, 65535, std::string("R03\0", 4));
    EXPECT_NE(refusal(header).find("its Exif (Adobe RGB)"), std::string::npos) << little;
    header.metadata.exif = exif(little, 2, std::string("R98\0", 4));
    EXPECT_NE(refusal(header).find("its Exif (Adobe RGB)"), std::string::npos) << little;
    header.metadata.exif = exif(little, 1, std::string("R98\0", 4));
    EXPECT_EQ(refusal(header), "") << little;
    const std::vector<std::uint8_t> whole = exif(little, 65535, std::string("R03\0", 4));
    for (std::size_t length = 0; length < whole.size(); ++length) {  // nothing is read behind the end
      header.metadata.exif.assign(whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(length));
      refusal(header);
    }
  }
}

}  // namespace
}  // namespace nodal::media
