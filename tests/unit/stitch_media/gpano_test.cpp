#include "stitch/media/gpano.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <numeric>
#include <utility>

#include "protocol/base/image.h"

namespace nodal::media {
namespace {

DecodedImage numbered(PixelFormat format, int width, int height) {
  DecodedImage image{format, width, height, std::vector<std::uint8_t>(packed_size(format, width, height))};
  std::iota(image.bytes.begin(), image.bytes.end(), std::uint8_t{1});
  return image;
}

TEST(Gpano, OfNoKnownDirection_ThePacketClaimsNoNorth) {
  const std::string packet = gpano_packet(400, 200);
  EXPECT_NE(packet.find("GPano:FullPanoWidthPixels=\"400\""), std::string::npos);
  EXPECT_EQ(packet.find("Pose"), std::string::npos);
  const std::string known = gpano_packet(400, 200, {{"GPano:PoseHeadingDegrees", "225"}, {"exif:Note", "<a & \"b\">"}});
  EXPECT_NE(known.find("GPano:PoseHeadingDegrees=\"225\""), std::string::npos);
  EXPECT_NE(known.find("exif:Note=\"&lt;a &amp; &quot;b&quot;&gt;\""), std::string::npos);
  EXPECT_NE(known.find("xmlns:exif="), std::string::npos);
  EXPECT_EQ(packet.find("xmlns:exif="), std::string::npos);
  EXPECT_EQ(xmp_packet({}), "");
}

TEST(Gpano, APart_IsPlacedOnTheSphereAndTheRestIsBlack) {
  for (const PixelFormat format : {PixelFormat::kGrey8, PixelFormat::kRgb24}) {
    const DecodedImage part = numbered(format, 3, 2);
    // Written for a picture of twice its size.
    const DecodedImage whole = whole_sphere(part, {16, 8, 4, 2, 6, 4}).value();
    ASSERT_EQ(whole.width, 8);
    ASSERT_EQ(whole.height, 4);
    const int channels = component_count(format);
    for (int y = 0; y < 4; ++y) {
      for (int x = 0; x < 8; ++x) {
        const bool present = x >= 2 && x < 5 && y >= 1 && y < 3;
        const int expected = present ? 1 + channels * (3 * (y - 1) + x - 2) : 0;
        EXPECT_EQ(whole.bytes[static_cast<std::size_t>(channels * (8 * y + x))], expected) << x << " " << y;
      }
    }
  }
}

TEST(Gpano, APartOf16Bits_IsPlacedWithBothBytes) {
  const DecodedImage part = numbered(PixelFormat::kRgb48, 3, 2);
  const DecodedImage whole = whole_sphere(part, {8, 4, 2, 1, 3, 2}).value();
  ASSERT_EQ(whole.bytes.size(), 8U * 4U * 6U);
  std::vector<std::uint8_t> expected(8U * 4U * 6U);
  for (std::ptrdiff_t y = 0; y < 2; ++y) {
    std::copy_n(part.bytes.begin() + y * 18, 18, expected.begin() + (8 * (y + 1) + 2) * 6);
  }
  EXPECT_EQ(whole.bytes, expected);
}

TEST(Gpano, AWholeSphereOrAnAreaThatIsNotSaid_LeavesThePictureAsItIs) {
  const DecodedImage part = numbered(PixelFormat::kGrey8, 4, 2);
  EXPECT_EQ(whole_sphere(part, {8, 4, 0, 0, 8, 4})->bytes, part.bytes);
  EXPECT_EQ(whole_sphere(part, {})->bytes, part.bytes);
}

/// The column of the sphere at which the part's first column is, and its first row; -1: nowhere.
std::pair<int, int> place_of_first(const DecodedImage& whole) {
  const auto at = std::ranges::find(whole.bytes, std::uint8_t{1});
  if (at == whole.bytes.end()) return {-1, -1};
  const auto k = static_cast<int>(at - whole.bytes.begin());
  return {k % whole.width, k / whole.width};
}

TEST(Gpano, AreasThatDoNotFitByRounding_AreMovedOrCut) {
  const DecodedImage part = numbered(PixelFormat::kGrey8, 8, 4);
  // One pixel too low, as phones round.
  EXPECT_EQ(place_of_first(whole_sphere(part, {64, 32, 10, 29, 8, 4}).value()), std::pair(10, 28));
  EXPECT_EQ(place_of_first(whole_sphere(part, {64, 32, 10, -1, 8, 4}).value()), std::pair(10, 0));
  // A pixel wider and higher than the sphere: the last column and row are cut.
  const DecodedImage cut = whole_sphere(part, {7, 3, 0, 0, 8, 4}).value();
  EXPECT_EQ(std::pair(cut.width, cut.height), std::pair(7, 3));
  EXPECT_EQ(cut.bytes[6], 7);
  EXPECT_EQ(cut.bytes[7], 9) << "the first of the next row";
}

TEST(Gpano, AnAreaOverTheEdge_GoesOnAtTheOtherOne) {
  const DecodedImage part = numbered(PixelFormat::kGrey8, 8, 4);
  for (const int left : {60, -4}) {
    const DecodedImage whole = whole_sphere(part, {64, 32, left, 5, 8, 4}).value();
    ASSERT_EQ(whole.width, 64);
    for (int y = 0; y < 32; ++y) {
      for (int x = 0; x < 64; ++x) {
        const int column = (x - 60 + 64) % 64;
        const int expected = column < 8 && y >= 5 && y < 9 ? 1 + 8 * (y - 5) + column : 0;
        ASSERT_EQ(whole.bytes[static_cast<std::size_t>(64 * y + x)], expected) << left << " " << x << " " << y;
      }
    }
  }
}

TEST(Gpano, ImpossibleAreas_AreRefusedWithAWayOut) {
  const DecodedImage part = numbered(PixelFormat::kGrey8, 4, 2);
  constexpr std::int64_t kHuge = std::numeric_limits<std::int64_t>::max();
  for (const SphereArea& area : {SphereArea{64, 32, 200, 0, 4, 2},
                                 {64, 32, -65, 0, 4, 2},
                                 {64, 32, 0, -3, 4, 2},
                                 {64, 32, 0, 33, 4, 2},
                                 {64, 32, 0, 0, 70, 2},
                                 {64, 32, 0, 0, -4, 2},
                                 {kHuge, 4, 0, 0, 4, 2},
                                 {kHuge, kHuge, kHuge, kHuge, kHuge, kHuge},
                                 {8, -4, 0, 0, 4, 2}}) {
    const auto refused = whole_sphere(part, area);
    ASSERT_FALSE(refused) << area.left << " " << area.width;
    EXPECT_EQ(refused.error().code, Errc::kBadFormat);
    EXPECT_NE(refused.error().message.find("--from equirectangular"), std::string::npos);
  }
  EXPECT_EQ(whole_sphere(part, {1 << 20, 1 << 20, 0, 0, 4, 2}).error().code, Errc::kTooLarge);
  EXPECT_EQ(whole_sphere(part, {std::int64_t{1} << 32, std::int64_t{1} << 32, 0, 0, 1, 1}).error().code,
            Errc::kTooLarge);
}

}  // namespace
}  // namespace nodal::media
