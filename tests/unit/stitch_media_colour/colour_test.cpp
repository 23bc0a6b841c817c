// Conversions beside the definitions of the colour spaces: IEC 61966-2-1, Adobe RGB (1998), Display P3.
#include "stitch/media/colour/colour.h"

#include <gtest/gtest.h>
#include <lcms2.h>

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>

namespace nodal::media {
namespace {

using Primaries = std::array<double, 8>;
constexpr Primaries kSrgb{0.3127, 0.3290, 0.64, 0.33, 0.30, 0.60, 0.15, 0.06};
constexpr Primaries kAdobe{0.3127, 0.3290, 0.64, 0.33, 0.21, 0.71, 0.15, 0.06};
constexpr Primaries kP3{0.3127, 0.3290, 0.680, 0.320, 0.265, 0.690, 0.150, 0.060};

Eigen::Vector3d xyz(double x, double y) { return {x / y, 1, (1 - x - y) / y}; }

/// To CIE XYZ, for a white of its own.
Eigen::Matrix3d to_xyz(const Primaries& p) {
  Eigen::Matrix3d corners;
  corners << xyz(p[2], p[3]), xyz(p[4], p[5]), xyz(p[6], p[7]);
  return corners * (corners.inverse() * xyz(p[0], p[1])).asDiagonal();
}

double encoded(double light) { return light <= 0.0031308 ? 12.92 * light : 1.055 * std::pow(light, 1 / 2.4) - 0.055; }
double decoded(double e) { return e <= 0.04045 ? e / 12.92 : std::pow((e + 0.055) / 1.055, 2.4); }

/// The level in sRGB, or in linear light, 0 to 1.
Eigen::Vector3d expected(const Eigen::Vector3d& level, const Primaries& from, double gamma, bool linear = false) {
  const Eigen::Vector3d light = level.unaryExpr([&](double e) { return gamma == 0 ? decoded(e) : std::pow(e, gamma); });
  const Eigen::Vector3d srgb = to_xyz(kSrgb).inverse() * to_xyz(from) * light;
  return srgb.unaryExpr([&](double l) {
    const double held = std::clamp(l, 0.0, 1.0);
    return linear ? held : encoded(held);
  });
}

constexpr int kSteps = 6;

/// Every combination of kSteps levels of the three colours; inside, so that few leave sRGB.
DecodedImage chart(bool deep) {
  DecodedImage image{deep ? PixelFormat::kRgb48 : PixelFormat::kRgb24, kSteps * kSteps, kSteps, {}};
  for (int k = 0; k < kSteps * kSteps * kSteps; ++k) {
    for (const int step : {k % kSteps, k / kSteps % kSteps, k / kSteps / kSteps}) {
      const int level = 40 + 32 * step;
      if (deep) image.bytes.push_back(static_cast<std::uint8_t>(level * 257));
      image.bytes.push_back(static_cast<std::uint8_t>(level));
    }
  }
  return image;
}

Eigen::Vector3d pixel(const DecodedImage& image, int k) {
  Eigen::Vector3d level;
  for (int c = 0; c < 3; ++c) {
    const auto at = static_cast<std::size_t>(3 * k + c);
    level[c] = is_linear16(image.format) ? (image.bytes[2 * at] | image.bytes[2 * at + 1] << 8) / 65535.0
                                         : image.bytes[at] / 255.0;
  }
  return level;
}

double largest_error(const DecodedImage& got, const DecodedImage& from, const Primaries& space, double gamma,
                     bool linear = false) {
  double worst = 0;
  for (int k = 0; k < kSteps * kSteps * kSteps; ++k) {
    const Eigen::Vector3d right = expected(pixel(from, k), space, gamma, linear);
    worst = std::max(worst, (pixel(got, k) - right).cwiseAbs().maxCoeff());
  }
  return worst;
}

std::vector<std::uint8_t> icc(const Primaries& p, double gamma) {
  const cmsCIExyY white{p[0], p[1], 1};
  const cmsCIExyYTRIPLE corners{{p[2], p[3], 1}, {p[4], p[5], 1}, {p[6], p[7], 1}};
  const std::array<double, 5> srgb{2.4, 1 / 1.055, 0.055 / 1.055, 1 / 12.92, 0.04045};
  cmsToneCurve* curve =
      gamma == 0 ? cmsBuildParametricToneCurve(nullptr, 4, srgb.data()) : cmsBuildGamma(nullptr, gamma);
  const std::array<cmsToneCurve*, 3> curves{curve, curve, curve};
  const cmsHPROFILE profile = cmsCreateRGBProfile(&white, &corners, curves.data());
  cmsUInt32Number length = 0;
  cmsSaveProfileToMem(profile, nullptr, &length);
  std::vector<std::uint8_t> bytes(length);
  cmsSaveProfileToMem(profile, bytes.data(), &length);
  cmsCloseProfile(profile);
  cmsFreeToneCurve(curve);
  return bytes;
}

TEST(Colour, ProfilesAndPrimaries_GiveTheColoursOfTheirDefinitions) {
  struct Space {
    const char* name;
    Primaries primaries;
    double gamma;
  };
  for (const Space& space : {Space{"Adobe RGB", kAdobe, 563.0 / 256}, Space{"Display P3", kP3, 0},
                             Space{"linear P3", kP3, 1}, Space{"sRGB's primaries, gamma 1.8", kSrgb, 1.8}}) {
    for (const bool deep : {false, true}) {
      for (const bool by_profile : {true, false}) {
        if (!by_profile && space.gamma == 0) continue;
        SCOPED_TRACE(testing::Message() << space.name << (deep ? " 16 bits" : " 8 bits") << by_profile);
        DecodedImage image = chart(deep);
        const DecodedImage from = image;
        if (by_profile) {
          image.meaning.icc = icc(space.primaries, space.gamma);
        } else {
          image.meaning.curve = SampleMeaning::Curve::kGamma;
          image.meaning.gamma = space.gamma;
          image.meaning.primaries = space.primaries;
        }
        const Status done = in_srgb(image, "a.png");
        ASSERT_TRUE(done) << done.error().text();
        const bool linear = deep && space.gamma == 1;
        EXPECT_EQ(image.meaning.is_linear(), linear);
        EXPECT_TRUE(image.meaning.icc.empty());
        EXPECT_LT(largest_error(image, from, space.primaries, space.gamma, linear), deep ? 0.0005 : 1.6 / 255);
      }
    }
  }
}

TEST(Colour, SrgbByAProfile_IsUnchangedToTheBit) {
  DecodedImage image = chart(false);
  const std::vector<std::uint8_t> before = image.bytes;
  image.meaning.icc = icc(kSrgb, 0);
  ASSERT_TRUE(in_srgb(image, "a.jpg"));
  EXPECT_EQ(image.bytes, before);
}

TEST(Colour, Linear16Bits_StayUntilTheyAreShown) {
  DecodedImage image{PixelFormat::kGrey16, 2, 1, {0xFF, 0x36, 0xFF, 0xFF}};  // 0x36FF: the light of sRGB 128
  image.meaning = SampleMeaning::linear();
  ASSERT_TRUE(in_srgb(image, "a.png"));
  EXPECT_EQ(image.bytes[1], 0x36);
  EXPECT_EQ(shown_in_8_bits(image).bytes, (std::vector<std::uint8_t>{128, 255}));
  image.meaning = {};
  EXPECT_EQ(shown_in_8_bits(image).bytes, (std::vector<std::uint8_t>{0x37, 255})) << "not linear: 14079 / 257 rounded";
}

TEST(Colour, LinearProfilesOfOurs_AreReadAsLinear) {
  for (const bool grey : {false, true}) {
    DecodedImage image{grey ? PixelFormat::kGrey16 : PixelFormat::kRgb48, 1, 1, {}};
    image.bytes.assign(grey ? 2 : 6, 0x36);
    const std::vector<std::uint8_t> before = image.bytes;
    image.meaning.icc = linear_profile(grey);
    EXPECT_EQ(image.meaning.icc, linear_profile(grey)) << "the same bytes always";
    ASSERT_TRUE(in_srgb(image, "a.tif"));
    EXPECT_TRUE(image.meaning.is_linear());
    for (std::size_t k = 0; k < before.size(); k += 2) {
      EXPECT_NEAR(image.bytes[k] | image.bytes[k + 1] << 8, 0x3636, 2);
    }
  }
}

TEST(Colour, AGreyPictureWithAProfileForColours_IsItsNeutralColours) {
  DecodedImage image{PixelFormat::kGrey8, 3, 1, {20, 128, 240}};
  image.meaning.icc = icc(kAdobe, 1.8);
  ASSERT_TRUE(in_srgb(image, "a.png"));
  ASSERT_EQ(image.bytes.size(), 3U);
  for (std::size_t k = 0; k < 3; ++k) {
    const double light = std::pow(std::array{20, 128, 240}[k] / 255.0, 1.8);
    EXPECT_NEAR(image.bytes[k], 255 * encoded(light), 1);
  }
}

TEST(Colour, ProfilesThatAreNone_AreRefusedWithThePicturesName) {
  for (const std::vector<std::uint8_t>& profile : {std::vector<std::uint8_t>{0}, std::vector<std::uint8_t>(200, 7), [] {
                                                     const cmsHPROFILE lab = cmsCreateLab4Profile(nullptr);
                                                     cmsUInt32Number length = 0;
                                                     cmsSaveProfileToMem(lab, nullptr, &length);
                                                     std::vector<std::uint8_t> bytes(length);
                                                     cmsSaveProfileToMem(lab, bytes.data(), &length);
                                                     cmsCloseProfile(lab);
                                                     return bytes;
                                                   }()}) {
    DecodedImage image = chart(false);
    image.meaning.icc = profile;
    const Status refused = in_srgb(image, "a.png");
    ASSERT_FALSE(refused);
    EXPECT_EQ(refused.error().code, Errc::kUnsupported);
    EXPECT_NE(refused.error().message.find("a.png"), std::string::npos);
    EXPECT_NE(refused.error().message.find("exiftool"), std::string::npos);
  }
  // Every bit of a good one, changed: never more than an error.
  const std::vector<std::uint8_t> good = icc(kP3, 0);
  for (std::size_t k = 0; k < good.size(); ++k) {
    DecodedImage image = chart(false);
    image.meaning.icc = good;
    image.meaning.icc[k] ^= static_cast<std::uint8_t>(1U << k % 8);
    (void)in_srgb(image, "a.png");
  }
}

}  // namespace
}  // namespace nodal::media
