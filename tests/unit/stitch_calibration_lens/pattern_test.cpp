#include "stitch/calibration/lens/pattern.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "protocol/base/sha256.h"

namespace nodal::calibration {
namespace {

const PatternRaster& small_pattern() {
  static const PatternRaster raster = *make_pattern({1024, 724, 1});
  return raster;
}

double at(const PatternRaster& raster, int x, int y) {
  return raster.values[static_cast<std::size_t>(y) * static_cast<std::size_t>(raster.width) +
                       static_cast<std::size_t>(x)] /
         255.0;
}

TEST(Pattern, PrintedYesterday_IsStillTheSameBytes) {
  // Printed patterns are used for years: this digest must never change for this spec.
  const PatternRaster raster = *make_pattern({320, 226, 7});
  EXPECT_EQ(to_hex(sha256(raster.values)), "c5d315f3beb6242ff7ae4bd49903673dbd5411d67ceeabe58477f09857e59973");
}

TEST(Pattern, AnotherSeed_IsAnotherPattern) {
  const PatternRaster other = *make_pattern({1024, 724, 2});
  int same = 0;
  for (std::size_t i = 0; i < other.values.size(); ++i) same += other.values[i] == small_pattern().values[i] ? 1 : 0;
  EXPECT_LT(same, static_cast<int>(other.values.size()) / 20);
}

TEST(Pattern, EveryOctaveOfSize_HoldsDetail) {
  // The variance of block means, minus that of blocks twice as large, is the detail between the two sizes.
  const PatternRaster& raster = small_pattern();
  std::vector<double> variance;
  for (int block = 2; block <= 128; block *= 2) {
    double sum = 0, square = 0;
    int n = 0;
    for (int y = 0; y + block <= raster.height; y += block) {
      for (int x = 0; x + block <= raster.width; x += block) {
        double mean = 0;
        for (int j = 0; j < block; ++j) {
          for (int i = 0; i < block; ++i) mean += at(raster, x + i, y + j);
        }
        mean /= block * block;
        sum += mean;
        square += mean * mean;
        ++n;
      }
    }
    variance.push_back(square / n - (sum / n) * (sum / n));
  }
  for (std::size_t k = 0; k + 1 < variance.size(); ++k) {
    EXPECT_GT(variance[k] - variance[k + 1], 0.0008) << "between blocks of " << (2 << k) << " px and twice that";
  }
}

TEST(Pattern, NoPatch_IsFoundTwice) {
  const PatternRaster& raster = small_pattern();
  constexpr int kSide = 80;
  const auto likeness = [&](int x0, int y0, int x1, int y1) {
    double a = 0, b = 0, aa = 0, bb = 0, ab = 0;
    for (int j = 0; j < kSide; j += 4) {
      for (int i = 0; i < kSide; i += 4) {
        const double p = at(raster, x0 + i, y0 + j);
        const double q = at(raster, x1 + i, y1 + j);
        a += p, b += q, aa += p * p, bb += q * q, ab += p * q;
      }
    }
    const double n = kSide * kSide / 16.0;
    return (ab - a * b / n) / std::sqrt((aa - a * a / n) * (bb - b * b / n));
  };
  double most = 0;
  for (int y = 0; y + kSide < raster.height; y += 3) {
    for (int x = 0; x + kSide < raster.width; x += 3) {
      if (std::abs(x - 500) < kSide && std::abs(y - 300) < kSide) continue;
      most = std::max(most, likeness(500, 300, x, y));
    }
  }
  EXPECT_LT(most, 0.7);
}

TEST(Pattern, SidesThatMakeNoPattern_AreRefusedWithTheLimits) {
  const auto refused = make_pattern({1024, 20, 1});
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, Errc::kBadValue);
  EXPECT_NE(refused.error().message.find("1024x20"), std::string::npos);
  EXPECT_FALSE(make_pattern({1 << 20, 1 << 20, 1}));
}

}  // namespace
}  // namespace nodal::calibration
