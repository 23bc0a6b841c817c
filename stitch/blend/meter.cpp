#include "stitch/blend/meter.h"

#include <algorithm>

namespace nodal::blend {
namespace {

struct Level {
  int luma = 0;
  int brightest = 0;  ///< level of the brightest colour, if there are colours
};

int mean_of_four(const PlaneView& plane, int x, int y) {
  const std::uint8_t* at = plane.data + y * plane.row_stride + std::ptrdiff_t{x} * plane.pixel_stride;
  const std::uint8_t* below = at + plane.row_stride;
  return (at[0] + at[plane.pixel_stride] + below[0] + below[plane.pixel_stride] + 2) / 4;
}

Level level_at(const ImageView& picture, const MeterTable::Sample& sample) {
  const int first = mean_of_four(picture.planes[0], sample.x, sample.y);
  if (picture.format != PixelFormat::kRgb24) return {first, first};
  const int green = mean_of_four(picture.planes[1], sample.x, sample.y);
  const int blue = mean_of_four(picture.planes[2], sample.x, sample.y);
  return {(77 * first + 150 * green + 29 * blue + 128) / 256, std::max({first, green, blue})};
}

/// log2(level / 255), for heads whose gamma is set; level 0 counts as a half.
constexpr std::array<std::int16_t, 256> kLevelStops = [] {
  std::array<std::int16_t, 256> stops{};
  for (std::uint64_t level = 0; level < 256; ++level) {
    stops[level] = static_cast<std::int16_t>(log2_stops(level == 0 ? 1 : 2 * level) - log2_stops(510));
  }
  return stops;
}();

/// The sum of stops over solid angles.
struct Sum {
  std::int64_t stops = 0;
  std::uint32_t solid_angle = 0;
  void add(Stops light, std::uint32_t weight) {
    stops += std::int64_t{light} * weight;
    solid_angle += weight;
  }
  Stops mean() const {
    return solid_angle == 0 ? 0 : static_cast<Stops>(stops / static_cast<std::int64_t>(solid_angle));
  }
};

/// The heads' measurements of one cell.
struct Verdict {
  std::int64_t sum = 0;
  int good = 0, clipped = 0, black = 0;
  Stops at_least = 0, at_most = 0;

  Stops light() const {
    if (good > 0) return static_cast<Stops>(sum / good);
    if (clipped > 0 && black > 0) return (at_least + at_most) / 2;
    return clipped > 0 ? at_least : at_most;
  }
};

}  // namespace

SphereLight meter(const MeterTable& table, std::span<const ImageView> heads, std::span<const ExposedHead> settings) {
  std::array<bool, kMaxHeads> present{};
  for (std::size_t h = 0; h < table.heads.size(); ++h) {
    present[h] = heads[h].planes[0].data != nullptr && heads[h].width == table.heads[h].width &&
                 heads[h].height == table.heads[h].height;
  }
  SphereLight sphere;
  std::array<Sum, kMaxHeads> sums{};
  Sum whole;
  std::size_t begin = 0;
  for (const MeterTable::Cell& cell : table.cells) {
    const auto samples = std::span(table.samples).subspan(begin, cell.end - begin);
    begin = cell.end;
    Verdict verdict;
    for (const MeterTable::Sample& sample : samples) {
      if (!present[sample.head]) continue;
      const ExposedHead& setting = settings[sample.head];
      const Level level = level_at(heads[sample.head], sample);
      const bool black = level.luma <= kBlackLevel;
      const auto at = static_cast<std::size_t>(level.luma + (black ? 1 : 0));  // black may have been rounded down
      const Stops shown = setting.gamma == 0 ? table.heads[sample.head].stops[at]
                                             : static_cast<Stops>(kLevelStops[at] * setting.gamma / 1000);
      const Stops light = shown - sample.lost - setting.exposure;
      HeadLight& own = sphere.heads[sample.head];
      if (level.brightest >= kClippedLevel) {
        own.clipped += cell.solid_angle;
        verdict.at_least = verdict.clipped++ == 0 ? light : std::max(verdict.at_least, light);
      } else if (black) {
        own.black += cell.solid_angle;
        verdict.at_most = verdict.black++ == 0 ? light : std::min(verdict.at_most, light);
      } else {
        verdict.sum += light;
        ++verdict.good;
      }
    }
    if (verdict.good + verdict.clipped + verdict.black == 0) continue;
    whole.add(verdict.light(), cell.solid_angle);
    for (const MeterTable::Sample& sample : samples) {
      if (present[sample.head]) sums[sample.head].add(verdict.light(), cell.solid_angle);
    }
  }
  for (std::size_t h = 0; h < table.heads.size(); ++h) {
    sphere.heads[h].exposure = settings[h].exposure;
    sphere.heads[h].overlaps = table.heads[h].overlaps;
    sphere.heads[h].light = sums[h].mean();
    sphere.heads[h].solid_angle = sums[h].solid_angle;
  }
  sphere.light = whole.mean();
  sphere.solid_angle = whole.solid_angle;
  return sphere;
}

}  // namespace nodal::blend
