// HEIF and WebP files of libheif's and libwebp's encoders, and broken ones.
#include "stitch/media/heif_webp/reader.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <utility>

#include "stitch/media/exif/exif.h"
#include "stitch/media/picture_bytes.h"
#include "tests/support/coded_files.h"
#include "tests/support/pictures.h"

namespace nodal::media {
namespace {

using test::CodedPicture;

/// A TIFF structure with Orientation alone.
std::vector<std::uint8_t> exif_with_orientation(std::uint8_t orientation) {
  return {'I', 'I', 42, 0, 8, 0, 0, 0, 1, 0, 0x12, 0x01, 3, 0, 1, 0, 0, 0, orientation, 0, 0, 0, 0, 0, 0, 0};
}

class CodedFile : public testing::Test {
 protected:
  PictureBytes open(const std::vector<std::uint8_t>& bytes) const {
    test::write_bytes(folder_ / "a.bin", bytes);
    return PictureBytes::open(folder_ / "a.bin").value();
  }
  Result<DecodedImage> decoded(const std::vector<std::uint8_t>& bytes) const {
    PictureBytes file = open(bytes);
    EXPECT_TRUE(is_heif_or_webp(file));
    return decode_heif_or_webp(file);
  }
  static CodedPicture picture(int width = 64, int height = 48, int seed = 1) {
    return {width, height, test::smooth_rgb(width, height, seed)};
  }
  test::TemporaryFolder folder_;
};

TEST_F(CodedFile, WebpWithoutLoss_IsThePictureToTheByte) {
  CodedPicture coded = picture();
  EXPECT_EQ(decoded(test::webp_of(coded))->bytes, coded.rgb);
  coded.icc = {1, 2, 3, 4, 5};
  coded.exif = exif_with_orientation(6);
  const auto image = decoded(test::webp_of(coded));
  ASSERT_TRUE(image) << image.error().text();
  EXPECT_EQ(image->bytes, coded.rgb);
  EXPECT_EQ(image->meaning.icc, coded.icc);
  EXPECT_EQ(image->metadata.exif, coded.exif);
  PictureBytes file = open(test::webp_of(coded));
  EXPECT_FALSE(is_turned(file)) << "WebP has no transformation: its Exif counts";
}

TEST_F(CodedFile, WebpWithAlpha_SaysSoAndKeepsItsColours) {
  CodedPicture coded = picture();
  coded.alpha = true;
  std::vector<std::uint8_t> rgba;
  for (std::size_t k = 0; k < coded.rgb.size(); k += 3) {
    rgba.insert(rgba.end(), {coded.rgb[k], coded.rgb[k + 1], coded.rgb[k + 2], static_cast<std::uint8_t>(1 + k % 200)});
  }
  const std::vector<std::uint8_t> rgb = std::exchange(coded.rgb, rgba);
  const auto image = decoded(test::webp_of(coded));
  ASSERT_TRUE(image) << image.error().text();
  EXPECT_TRUE(image->meaning.alpha);
  EXPECT_EQ(image->bytes, rgb);
  std::vector<std::uint8_t> alpha;
  for (std::size_t k = 3; k < rgba.size(); k += 4) alpha.push_back(rgba[k]);
  PictureBytes file = open(test::webp_of(coded));
  EXPECT_EQ(decode_heif_or_webp_opacity(file)->bytes, alpha);
}

TEST_F(CodedFile, HeifWithAlpha_IsAsOpaqueAsItSays) {
  if (!test::can_code_heif()) GTEST_SKIP() << "libheif has no encoder of HEVC here";
  CodedPicture coded = picture();
  PictureBytes plain = open(test::heif_of(coded));
  EXPECT_EQ(decode_heif_or_webp_opacity(plain)->bytes, std::vector<std::uint8_t>(64 * 48, 255));
  coded.alpha = true;
  std::vector<std::uint8_t> rgba;
  for (std::size_t k = 0; k < coded.rgb.size(); k += 3) {
    const std::uint8_t opaque = k / 3 % 64 < 32 ? 0 : 255;
    rgba.insert(rgba.end(), {coded.rgb[k], coded.rgb[k + 1], coded.rgb[k + 2], opaque});
  }
  coded.rgb = rgba;
  PictureBytes file = open(test::heif_of(coded));
  const auto opacity = decode_heif_or_webp_opacity(file);
  ASSERT_TRUE(opacity) << opacity.error().text();
  for (int k = 0; k < 64 * 48; ++k)
    EXPECT_NEAR(opacity->bytes[static_cast<std::size_t>(k)], k % 64 < 32 ? 0 : 255, 60) << k;
}

TEST_F(CodedFile, AnimatedWebp_IsRefusedWithWhatToDo) {
  const auto image = decoded(test::animated_webp());
  ASSERT_FALSE(image);
  EXPECT_EQ(image.error().code, Errc::kUnsupported);
  EXPECT_NE(image.error().message.find("webpmux -get frame 1"), std::string::npos) << image.error().message;
}

TEST_F(CodedFile, Heif_IsThePictureTurnedAsItSays) {
  if (!test::can_code_heif()) GTEST_SKIP() << "libheif has no encoder of HEVC here";
  const CodedPicture coded = picture();
  const auto plain = decoded(test::heif_of(coded));
  ASSERT_TRUE(plain) << plain.error().text();
  EXPECT_GT(test::psnr(plain->bytes, coded.rgb), 38);
  // Orientation 6: people see it turned clockwise by a quarter.
  CodedPicture turned = coded;
  turned.exif = exif_with_orientation(6);
  const auto bytes = test::heif_of(turned, 6);
  const auto image = decoded(bytes);
  ASSERT_TRUE(image) << image.error().text();
  ASSERT_EQ(image->width, 48);
  ASSERT_EQ(image->height, 64);
  std::vector<std::uint8_t> expected;
  for (int y = 0; y < 64; ++y) {
    for (int x = 0; x < 48; ++x) {
      const auto from = coded.rgb.begin() + 3 * ((47 - x) * 64 + y);
      expected.insert(expected.end(), from, from + 3);
    }
  }
  EXPECT_GT(test::psnr(image->bytes, expected), 38);
  PictureBytes file = open(bytes);
  EXPECT_TRUE(is_turned(file)) << "its Exif, which says so too, must not turn it again";
  EXPECT_EQ(exif_of(image->metadata).orientation, 6);
  const auto header = heif_or_webp_header(file);
  ASSERT_TRUE(header);
  EXPECT_EQ(header->width, 48);
}

TEST_F(CodedFile, HeifOfABurst_IsItsPrimaryPicture) {
  if (!test::can_code_heif()) GTEST_SKIP() << "libheif has no encoder of HEVC here";
  const CodedPicture coded = picture();
  const auto bytes = test::heif_of(coded, 1, {picture(32, 32, 2), picture(64, 48, 3)});
  const auto image = decoded(bytes);
  ASSERT_TRUE(image) << image.error().text();
  ASSERT_EQ(image->width, 64);
  EXPECT_GT(test::psnr(image->bytes, coded.rgb), 38);
  const auto count = [&](const std::vector<std::uint8_t>& one) {
    PictureBytes file = open(one);
    return count_pictures(file);
  };
  EXPECT_EQ(count(bytes), 3);
  EXPECT_EQ(count(test::heif_of(coded)), 1);
  EXPECT_EQ(count(test::webp_of(coded)), 1);
}

TEST_F(CodedFile, HeifsProfile_IsKept) {
  if (!test::can_code_heif()) GTEST_SKIP() << "libheif has no encoder of HEVC here";
  CodedPicture coded = picture();
  coded.icc = std::vector<std::uint8_t>(300, 7);
  EXPECT_EQ(decoded(test::heif_of(coded))->meaning.icc, coded.icc);
}

TEST_F(CodedFile, FilesThatEndEarly_AreErrorsThatNameThem) {
  std::vector<std::vector<std::uint8_t>> files{test::webp_of(picture(200, 150))};
  if (test::can_code_heif()) files.push_back(test::heif_of(picture(200, 150)));
  for (const std::vector<std::uint8_t>& whole : files) {
    for (const std::size_t length :
         {std::size_t{12}, std::size_t{24}, whole.size() / 4, whole.size() / 2, whole.size() - 20}) {
      const auto image = decoded({whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(length)});
      ASSERT_FALSE(image) << length;
      EXPECT_NE(image.error().message.find("a.bin"), std::string::npos) << image.error().message;
    }
  }
}

/// A header that claims 16383 x 16383 pixels in 30 bytes.
TEST_F(CodedFile, HugeClaims_AreRefusedBeforeTheyAreDecoded) {
  std::vector<std::uint8_t> webp = test::webp_of(picture(2, 2));
  // VP8L: the signature 0x2f, then width - 1 and height - 1 of 14 bits each.
  const auto signature = std::ranges::find(webp, std::uint8_t{0x2f});
  ASSERT_NE(signature, webp.end());
  std::fill_n(signature + 1, 3, std::uint8_t{0xff});
  *(signature + 4) |= 0x0f;
  PictureBytes file = open(webp);
  const auto header = heif_or_webp_header(file);
  ASSERT_TRUE(header) << "16384 x 16384 are just 2^28 pixels";
  EXPECT_EQ(header->width, 16384);
  EXPECT_FALSE(decoded(webp)) << "there are no data for them";
}

TEST_F(CodedFile, BrokenBytes_NeverMoreThanAnError) {
  std::mt19937 random(7);
  std::vector<std::vector<std::uint8_t>> files{test::webp_of(picture())};
  if (test::can_code_heif()) files.push_back(test::heif_of(picture()));
  for (const std::vector<std::uint8_t>& whole : files) {
    for (int k = 0; k < 300; ++k) {
      std::vector<std::uint8_t> bytes = whole;
      for (int n = 0; n < 1 + k % 4; ++n)
        bytes[12 + random() % (bytes.size() - 12)] = static_cast<std::uint8_t>(random());
      PictureBytes file = open(bytes);
      if (!is_heif_or_webp(file)) continue;
      const auto image = decode_heif_or_webp(file);
      if (image) {
        EXPECT_EQ(image->bytes.size(), packed_size(image->format, image->width, image->height));
      } else {
        EXPECT_NE(image.error().message.find("a.bin"), std::string::npos);
      }
    }
  }
}

}  // namespace
}  // namespace nodal::media
