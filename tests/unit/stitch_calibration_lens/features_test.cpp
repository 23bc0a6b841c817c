#include "stitch/calibration/lens/features.h"

#include <gtest/gtest.h>

#include <cmath>

#include "stitch/calibration/lens/pattern.h"
#include "stitch/calibration/lens/scale_space.h"

namespace nodal::calibration {
namespace {

GreyImage pattern_image(std::uint64_t seed) {
  const PatternRaster raster = *make_pattern({640, 452, seed});
  GreyImage image(raster.width, raster.height);
  for (std::size_t i = 0; i < raster.values.size(); ++i) {
    image.values[i] = static_cast<float>(raster.values[i]) / 255.0F;
  }
  return image;
}

TEST(Features, TurnedSmallerAndDarkerPicture_MatchesPlaceForPlace) {
  const GreyImage image = pattern_image(1);
  const ScaleSpace space(image);
  const double scale = 1.4, c = std::cos(0.6), s = std::sin(0.6);
  GreyImage seen(400, 300);
  for (int j = 0; j < seen.height; ++j) {
    for (int i = 0; i < seen.width; ++i) {
      const double x = scale * (i + 0.5 - 200), y = scale * (j + 0.5 - 150);
      const double light = space.at(320 + c * x - s * y, 226 + s * x + c * y, scale * 0.7).value;
      seen.row(j)[i] = static_cast<float>(0.1 + 0.5 * light);
    }
  }
  const Features a = find_features(seen, 1000);
  const Features b = find_features(image, 3000);
  int inside = 0;
  int right = 0;
  for (const Match& match : match_features(a, b)) {
    const Feature& p = a.points[static_cast<std::size_t>(match.photo)];
    const Feature& q = b.points[static_cast<std::size_t>(match.pattern)];
    const double x = scale * (p.x - 200), y = scale * (p.y - 150);
    const double tx = 320 + c * x - s * y, ty = 226 + s * x + c * y;
    if (tx < 0 || ty < 0 || tx > 640 || ty > 452) continue;
    ++inside;
    right += std::hypot(q.x - tx, q.y - ty) < 3 ? 1 : 0;
  }
  EXPECT_GT(inside, 60);
  EXPECT_GT(right, 0.8 * inside);
}

TEST(Features, AnotherPattern_HardlyMatches) {
  const Features a = find_features(pattern_image(1), 1000);
  const Features b = find_features(pattern_image(2), 3000);
  EXPECT_LT(match_features(a, b).size(), a.points.size() / 20);
}

TEST(Features, FlatPicture_HasNone) {
  GreyImage flat(200, 150);
  for (float& value : flat.values) value = 0.4F;
  EXPECT_TRUE(find_features(flat, 1000).points.empty());
  EXPECT_TRUE(match_features(find_features(flat, 10), find_features(pattern_image(1), 100)).empty());
}

}  // namespace
}  // namespace nodal::calibration
