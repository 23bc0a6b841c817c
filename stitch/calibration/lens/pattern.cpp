#include "stitch/calibration/lens/pattern.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <string>

namespace nodal::calibration {
namespace {

/// splitmix64 (Steele, Lea, Flood 2014): the same numbers on every machine.
class Random {
 public:
  explicit Random(std::uint64_t seed) : state_(seed) {}
  std::uint64_t next() {
    state_ += 0x9E3779B97F4A7C15ULL;
    std::uint64_t z = state_;
    z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9ULL;
    z = (z ^ (z >> 27)) * 0x94D049BB133111EBULL;
    return z ^ (z >> 31);
  }
  /// 0 <= x < 1
  double uniform() { return static_cast<double>(next() >> 11) * 0x1.0p-53; }

 private:
  std::uint64_t state_;
};

constexpr double kLargestRadius = 1.0 / 18;  // share of the longer side
constexpr double kSmallestRadius = 2.0;      // px
constexpr double kCoverage = 0.5;            // share of the area that the discs of one octave cover
constexpr float kStep = 0.62F;               // change of grey, before the values are compressed to 0..1

struct Disc {
  double x, y, radius;
  float step;
};

void add_disc(const Disc& disc, int width, int height, std::vector<float>& sum) {
  const int top = std::max(0, static_cast<int>(std::floor(disc.y - disc.radius - 1)));
  const int bottom = std::min(height, static_cast<int>(std::ceil(disc.y + disc.radius + 1)));
  const int left = std::max(0, static_cast<int>(std::floor(disc.x - disc.radius - 1)));
  const int right = std::min(width, static_cast<int>(std::ceil(disc.x + disc.radius + 1)));
  for (int j = top; j < bottom; ++j) {
    const double dy = j + 0.5 - disc.y;
    float* row = sum.data() + static_cast<std::size_t>(j) * static_cast<std::size_t>(width);
    for (int i = left; i < right; ++i) {
      const double dx = i + 0.5 - disc.x;
      const double inside = disc.radius + 0.5 - std::sqrt(dx * dx + dy * dy);
      if (inside > 0) row[i] += disc.step * static_cast<float>(std::min(inside, 1.0));
    }
  }
}

}  // namespace

Result<PatternRaster> make_pattern(const PatternSpec& spec) {
  for (const int side : {spec.width, spec.height}) {
    if (side < kMinPatternSide || side > kMaxPatternSide) {
      return fail(Errc::kBadValue, fmt::format("a pattern of {}x{} px cannot be made; both sides must be {} to {}",
                                               spec.width, spec.height, kMinPatternSide, kMaxPatternSide));
    }
  }
  const double area = static_cast<double>(spec.width) * spec.height;
  Random random(spec.seed);
  std::vector<float> sum(static_cast<std::size_t>(spec.width) * static_cast<std::size_t>(spec.height), 0.0F);
  for (double radius = kLargestRadius * std::max(spec.width, spec.height); radius >= kSmallestRadius; radius /= 2) {
    // Radii are uniform over [1, 2) times the octave's radius, so their mean square is 7/3 of its square.
    const auto count = static_cast<int>(kCoverage * area / (3.141592653589793 * radius * radius * 7 / 3));
    for (int n = 0; n < count; ++n) {
      Disc disc{};
      disc.x = random.uniform() * spec.width;
      disc.y = random.uniform() * spec.height;
      disc.radius = radius * (1 + random.uniform());
      const double size = 0.5 + 0.5 * random.uniform();
      disc.step = kStep * static_cast<float>((random.next() & 1) != 0 ? size : -size);
      add_disc(disc, spec.width, spec.height, sum);
    }
  }
  PatternRaster raster{spec.width, spec.height, {}};
  raster.values.reserve(sum.size());
  for (const float s : sum) {
    // Maps any sum to 0..1 without clipping, using only operations that give the same bits with every library.
    const float grey = 0.5F + 0.5F * s / (0.6F + std::abs(s));
    raster.values.push_back(static_cast<std::uint8_t>(std::clamp(grey, 0.0F, 1.0F) * 255.0F + 0.5F));
  }
  return raster;
}

}  // namespace nodal::calibration
