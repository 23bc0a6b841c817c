// Exif written here byte by byte after the standard (CIPA DC-008, TIFF 6.0), in both byte orders.
#include "stitch/media/exif/exif.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <string>
#include <vector>

namespace nodal::media {
namespace {

struct Tag {
  std::uint16_t tag;
  std::uint16_t type;  // 3: SHORT, 4: LONG, 5: RATIONAL
  std::uint32_t value;
  std::uint32_t denominator = 1;
};

/// The beginning of a JPEG with the tags of the two directories.
std::vector<std::uint8_t> jpeg_with(const std::vector<Tag>& first, const std::vector<Tag>& exif, bool big_endian) {
  std::vector<std::uint8_t> tiff;
  const auto put = [&](std::uint32_t value, int bytes) {
    for (int k = 0; k < bytes; ++k) {
      tiff.push_back(static_cast<std::uint8_t>(value >> 8 * (big_endian ? bytes - 1 - k : k)));
    }
  };
  const auto directory = [&](std::vector<Tag> tags, bool links) {
    const std::size_t count = tags.size() + (links ? 1 : 0);
    const auto begin = static_cast<std::uint32_t>(tiff.size());
    std::uint32_t later = begin + 2 + static_cast<std::uint32_t>(12 * count) + 4;  // rationals
    put(static_cast<std::uint32_t>(count), 2);
    std::vector<Tag> rationals;
    for (const Tag& tag : tags) {
      put(tag.tag, 2), put(tag.type, 2), put(1, 4);
      if (tag.type == 3) put(tag.value, 2), put(0, 2);
      if (tag.type == 4) put(tag.value, 4);
      if (tag.type == 5) put(later, 4), later += 8, rationals.push_back(tag);
    }
    if (links) put(0x8769, 2), put(4, 2), put(1, 4), put(later, 4);
    put(0, 4);
    for (const Tag& tag : rationals) put(tag.value, 4), put(tag.denominator, 4);
  };
  tiff = big_endian ? std::vector<std::uint8_t>{'M', 'M', 0, 42, 0, 0, 0, 8}
                    : std::vector<std::uint8_t>{'I', 'I', 42, 0, 8, 0, 0, 0};
  directory(first, true);
  directory(exif, false);
  const std::size_t length = tiff.size() + 8;
  std::vector<std::uint8_t> jpeg{
      0xff, 0xd8, 0xff, 0xe1, static_cast<std::uint8_t>(length >> 8), static_cast<std::uint8_t>(length), 'E', 'x',
      'i',  'f',  0,    0};
  for (const std::uint8_t byte : tiff) jpeg.push_back(byte);
  jpeg.push_back(0xff);
  jpeg.push_back(0xd9);
  return jpeg;
}

constexpr std::uint16_t kOrientation = 0x0112, kFocalLength = 0x920a, kFilm = 0xa405, kWidth = 0xa002, kHeight = 0xa003,
                        kPlaneX = 0xa20e, kPlaneUnit = 0xa210;

TEST(Exif, FocalLengthOfFilmAndOrientation_InBothByteOrders) {
  for (const bool big_endian : {false, true}) {
    const Exif exif = parse_exif(jpeg_with({{kOrientation, 3, 6}}, {{kFilm, 3, 28}}, big_endian));
    ASSERT_TRUE(exif.focal_35mm);
    EXPECT_EQ(*exif.focal_35mm, 28);
    EXPECT_EQ(exif.orientation, 6);
  }
}

TEST(Exif, FocalPlaneResolution_GivesTheSameFocalLength) {
  // A sensor of 22.3 mm across with 4000 x 3000 pixels, and a lens of 18 mm: 4000 / 2.23 pixels a centimetre.
  const std::vector<Tag> tags{
      {kFocalLength, 5, 180, 10}, {kWidth, 4, 4000}, {kHeight, 3, 3000}, {kPlaneX, 5, 400000, 223}, {kPlaneUnit, 3, 3}};
  const Exif exif = parse_exif(jpeg_with({}, tags, false));
  ASSERT_TRUE(exif.focal_35mm);
  EXPECT_NEAR(*exif.focal_35mm, 18 * 43.26661530556787 / (22.3 * 5 / 4), 1e-9) << "4:3 has 5/4 of its width across";
  std::vector<Tag> inches = tags;
  inches[3] = {kPlaneX, 5, 4000 * 254, 223};
  inches[4].value = 2;
  EXPECT_NEAR(*parse_exif(jpeg_with({}, inches, true)).focal_35mm, *exif.focal_35mm, 1e-9);
}

TEST(Exif, NothingKnownOrNonsense_SaysNothing) {
  EXPECT_FALSE(parse_exif(jpeg_with({}, {{kFilm, 3, 0}}, false)).focal_35mm) << "0: unknown";
  EXPECT_FALSE(parse_exif(jpeg_with({}, {{kFilm, 3, 60000}}, false)).focal_35mm);
  EXPECT_FALSE(
      parse_exif(jpeg_with({}, {{kFocalLength, 5, 18, 0}, {kWidth, 4, 0}, {kHeight, 4, 0}, {kPlaneX, 5, 1, 0}}, false))
          .focal_35mm);
  EXPECT_EQ(parse_exif(jpeg_with({{kOrientation, 3, 77}}, {}, false)).orientation, 1);
  EXPECT_FALSE(parse_exif({}).focal_35mm);
}

TEST(Exif, AQuarterTurnOfAPictureThatIsHigherThanWide_IsOutdated) {
  for (const int quarter : {5, 6, 7, 8}) {
    EXPECT_TRUE(is_outdated(quarter, 540, 720)) << quarter;
    EXPECT_FALSE(is_outdated(quarter, 720, 540)) << "as a camera writes it";
    EXPECT_FALSE(is_outdated(quarter, 600, 600)) << "nobody knows";
  }
  for (const int other : {1, 2, 3, 4}) EXPECT_FALSE(is_outdated(other, 540, 720)) << other;
}

TEST(Exif, CutOffAnywhere_SaysNothingFalse) {
  const std::vector<std::uint8_t> whole = jpeg_with({{kOrientation, 3, 6}}, {{kFilm, 3, 28}}, false);
  for (std::size_t length = 0; length < whole.size(); ++length) {
    const Exif exif = parse_exif(std::span(whole).first(length));
    EXPECT_TRUE(!exif.focal_35mm || *exif.focal_35mm == 28) << length;
  }
}

}  // namespace
}  // namespace nodal::media
