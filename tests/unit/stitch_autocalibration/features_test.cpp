// Features and matches of a picture and of the same picture turned, reduced, and of noise.
#include "stitch/autocalibration/features.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <random>

#include "stitch/autocalibration/matches.h"

namespace nodal::autocalibration {
namespace {

// Soft blobs of random places, sizes and levels.
Picture blobs(int side, std::uint64_t seed) {
  Picture picture{side, side, std::vector<float>(static_cast<std::size_t>(side) * static_cast<std::size_t>(side), 128)};
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<double> unit(0, 1);
  for (int n = 0; n < 250; ++n) {
    const double x = side * unit(random), y = side * unit(random), size = 2 + 8 * unit(random) * unit(random);
    const double level = 160 * (unit(random) - 0.5), stretch = 0.5 + unit(random);
    for (int j = 0; j < side; ++j) {
      for (int i = 0; i < side; ++i) {
        const double dx = (i + 0.5 - x) / size, dy = (j + 0.5 - y) / (size * stretch);
        const double square = dx * dx + dy * dy;
        if (square < 16)
          picture.values[static_cast<std::size_t>(j * side + i)] += static_cast<float>(level * std::exp(-square / 2));
      }
    }
  }
  return picture;
}

Region whole(const Picture& picture) {
  return {0, 0, static_cast<double>(picture.width), static_cast<double>(picture.height), {}};
}

TEST(Features, PictureTurnedByARightAngle_MatchesAreExact) {
  const Picture picture = blobs(300, 1);
  Picture turned = picture;  // clockwise: (x, y) goes to (300 - y, x)
  for (int y = 0; y < 300; ++y) {
    for (int x = 0; x < 300; ++x)
      turned.values[static_cast<std::size_t>(x * 300 + 299 - y)] =
          picture.values[static_cast<std::size_t>(y * 300 + x)];
  }
  const auto a = find_features(picture, whole(picture), 1000), b = find_features(turned, whole(turned), 1000);
  const std::vector<Match> matches = find_matches(0, a, 1, b);
  ASSERT_GT(matches.size(), 60U);
  std::size_t right = 0;
  for (const Match& match : matches) {
    right += std::hypot(match.pixel_b.x - (300 - match.pixel_a.y), match.pixel_b.y - match.pixel_a.x) < 0.5 ? 1 : 0;
  }
  EXPECT_GT(static_cast<double>(right), 0.95 * static_cast<double>(matches.size()));
}

TEST(Features, InAMask_AreNotFoundNorNearerThanADescriptorReaches) {
  const Picture picture = blobs(300, 1);
  Region region = whole(picture);
  const std::size_t all = find_features(picture, region, 1000).size();
  region.masks = {{{100, 100}, {200, 100}, {200, 200}, {100, 200}}};
  const auto left = find_features(picture, region, 1000);
  EXPECT_LT(left.size(), all);
  EXPECT_GT(left.size(), all / 3);
  for (const Feature& feature : left) {
    const double dx = std::max({100 - feature.pixel.x, feature.pixel.x - 200, 0.0});
    const double dy = std::max({100 - feature.pixel.y, feature.pixel.y - 200, 0.0});
    EXPECT_GE(std::hypot(dx, dy), 6 * feature.scale - 0.01);
  }
}

TEST(Features, PictureOfHalfTheSize_MatchesAreAtHalfTheCoordinates) {
  const Picture picture = blobs(400, 2);
  Picture half{200, 200, {}};
  for (int y = 0; y < 200; ++y) {
    for (int x = 0; x < 200; ++x) {
      const auto at = [&](int i, int j) {
        return picture.values[static_cast<std::size_t>((2 * y + j) * 400 + 2 * x + i)];
      };
      half.values.push_back((at(0, 0) + at(1, 0) + at(0, 1) + at(1, 1)) / 4);
    }
  }
  const std::vector<Match> matches =
      find_matches(0, find_features(picture, whole(picture), 1000), 1, find_features(half, whole(half), 1000));
  ASSERT_GT(matches.size(), 30U);
  double sum = 0;
  std::size_t right = 0;
  for (const Match& match : matches) {
    const double off = std::hypot(match.pixel_b.x - match.pixel_a.x / 2, match.pixel_b.y - match.pixel_a.y / 2);
    if (off > 1) continue;
    ++right;
    sum += match.pixel_b.x - match.pixel_a.x / 2;
  }
  EXPECT_GT(static_cast<double>(right), 0.9 * static_cast<double>(matches.size()));
  // With pixel centres at integers in one picture only, they would be off by a quarter.
  EXPECT_NEAR(sum / static_cast<double>(right), 0, 0.05);
}

TEST(Features, OutsideOfTheRegion_ThereAreNone) {
  const Picture picture = blobs(300, 3);
  Region region = whole(picture);
  region.circle = Region::Circle{150, 150, 100};
  const auto features = find_features(picture, region, 1000);
  ASSERT_GT(features.size(), 20U);
  for (const Feature& feature : features) EXPECT_LT(std::hypot(feature.pixel.x - 150, feature.pixel.y - 150), 100);
}

TEST(Features, MoreThanWanted_AreSpreadOverThePicture) {
  const Picture picture = blobs(400, 4);
  const auto features = find_features(picture, whole(picture), 40);
  ASSERT_EQ(features.size(), 40U);
  int left = 0;
  for (const Feature& feature : features) left += feature.pixel.x < 200 ? 1 : 0;
  EXPECT_GT(left, 10);
  EXPECT_LT(left, 30);
}

TEST(Features, FlatAndTinyPictures_HaveNone) {
  for (const int side : {1, 2, 3, 8, 200}) {
    const Picture flat{side, side,
                       std::vector<float>(static_cast<std::size_t>(side) * static_cast<std::size_t>(side), 77)};
    EXPECT_TRUE(find_features(flat, whole(flat), 100).empty()) << side;
  }
  EXPECT_TRUE(find_matches(0, {}, 1, {}).empty());
}

TEST(Features, UnrelatedPictures_HardlyMatch) {
  const Picture a = blobs(300, 5), b = blobs(300, 6);
  const auto in_a = find_features(a, whole(a), 1000);
  EXPECT_LT(find_matches(0, in_a, 1, find_features(b, whole(b), 1000)).size(), in_a.size() / 5);
}

TEST(Features, OfARim_AreFoundWhereDescriptorsReachBeyondTheCircle) {
  const Picture whole_picture = blobs(400, 5);
  Picture picture = whole_picture;
  const Region region{0, 0, 400, 400, Region::Circle{200, 200, 180}};
  for (int y = 0; y < 400; ++y) {
    for (int x = 0; x < 400; ++x) {
      if (std::hypot(x + 0.5 - 200, y + 0.5 - 200) > 180) picture.values[static_cast<std::size_t>(y * 400 + x)] = 0;
    }
  }
  const auto inner = find_features(picture, region, 4000), rim = find_rim_features(picture, region, 4000, 150);
  const auto radius_of = [](const Feature& f) { return std::hypot(f.pixel.x - 200, f.pixel.y - 200); };
  const auto beyond = [&](const Feature& f) { return radius_of(f) + 6 * f.scale > 180; };
  for (const Feature& feature : inner) EXPECT_FALSE(beyond(feature));
  for (const Feature& feature : rim) {
    EXPECT_GE(radius_of(feature), 150);
    EXPECT_LE(radius_of(feature) + 2 * feature.scale, 180);
  }
  // They match those of the picture without an edge, at the same places.
  std::vector<Feature> near_edge;
  for (const Feature& feature : rim) {
    if (beyond(feature)) near_edge.push_back(feature);
  }
  const auto matches = find_matches(0, near_edge, 1, find_features(whole_picture, whole(whole_picture), 4000));
  ASSERT_GT(matches.size(), 10U);
  const auto right = std::ranges::count_if(matches, [](const Match& match) {
    return std::hypot(match.pixel_a.x - match.pixel_b.x, match.pixel_a.y - match.pixel_b.y) < 1;
  });
  EXPECT_GT(10 * right, 9 * std::ssize(matches));
}

TEST(Matches, OfAPictureWhoseHalvesAreTheSame_AreAmbiguous) {
  const Picture part = blobs(200, 6), other = blobs(400, 7);
  Picture tiles{400, 400, std::vector<float>(400 * 400)};
  for (int y = 0; y < 400; ++y) {
    for (int x = 0; x < 400; ++x) tiles.values[static_cast<std::size_t>(y * 400 + x)] = part.at(x % 200, y % 200);
  }
  const auto in_tiles = find_features(tiles, whole(tiles), 1000), in_other = find_features(other, whole(other), 1000);
  Repetition of_tiles, of_other, of_both;
  find_matches(0, in_tiles, 1, in_tiles, &of_tiles);
  find_matches(0, in_other, 1, in_other, &of_other);
  find_matches(0, in_other, 1, in_tiles, &of_both);
  EXPECT_TRUE(of_tiles.prevails()) << of_tiles.ambiguous << " of " << of_tiles.features;
  EXPECT_FALSE(of_other.prevails()) << of_other.ambiguous << " of " << of_other.features;
  EXPECT_FALSE(of_both.prevails()) << "pictures of different things: " << of_both.ambiguous;
}

}  // namespace
}  // namespace nodal::autocalibration
