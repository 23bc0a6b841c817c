// Tables and pictures by hand, small enough to calculate on paper, and random ones within a valid table's ranges.
#pragma once

#include <algorithm>
#include <cstdint>
#include <random>
#include <vector>

#include "protocol/base/image.h"
#include "stitch/blend/blend.h"

namespace nodal::blend::test {

/// A picture that owns its memory.
struct Picture {
  Picture(PixelFormat format_, int width_, int height_, std::uint8_t fill = 0)
      : format(format_), width(width_), height(height_), bytes(packed_size(format_, width_, height_), fill) {}
  ImageView view() const { return packed_image(format, width, height, bytes.data()); }
  MutableImageView mutable_view() { return packed_image(format, width, height, bytes.data()); }
  PixelFormat format;
  int width;
  int height;
  std::vector<std::uint8_t> bytes;
};

/// A sample of a picture; 16 bits if the format has 16-bit samples.
inline int sample_of(const ImageView& image, int c, int x, int y) {
  const PlaneView& plane = image.planes[static_cast<std::size_t>(c)];
  const std::uint8_t* at = plane.data + y * plane.row_stride + std::ptrdiff_t{x} * plane.pixel_stride;
  return is_linear16(image.format) ? at[0] | at[1] << 8 : at[0];
}

inline Picture noise(std::mt19937& random, PixelFormat format, int width, int height) {
  Picture picture(format, width, height);
  for (auto& byte : picture.bytes) byte = static_cast<std::uint8_t>(random());
  return picture;
}

inline constexpr std::uint16_t kOneGain = 1 << kGainBits;
inline constexpr int kOneWeight = 1 << kWeightBits;
inline constexpr std::uint16_t kOnePixel = 1 << kFractionBits;

/// One head's contribution to one pixel of a hand-made table.
struct Look {
  HeadIndex head = 0;
  int x = 0;  ///< position in the picture, at most 16 x 16 samples, in 1/4096 samples
  int y = 0;
  int weight = kOneWeight;
};

/// The table of a grey raymap with one row of up to eight pixels; looks[i] makes pixel i; one record per head.
inline BlendTable grey_row(const std::vector<std::vector<Look>>& looks, int heads, int side) {
  BlendTable table;
  table.format = PixelFormat::kGrey8;
  table.width = static_cast<int>(looks.size());
  table.height = 1;
  table.sources.assign(static_cast<std::size_t>(heads), {PixelFormat::kGrey8, side, side});
  GridTable grid;
  grid.width = table.width;
  grid.height = 1;
  grid.tiles.push_back({0, static_cast<std::uint32_t>(Sharing::kOpen) << 30});
  for (int h = 0; h < heads; ++h) {
    PatchRecord record;
    record.source = PatchRecord::source_of(static_cast<HeadIndex>(h), 0, true);
    record.x[0] = static_cast<std::int16_t>(h);
    grid.records.push_back(record);
    grid.weights.resize(grid.weights.size() + kTilePixels);
    grid.coordinates.resize(grid.coordinates.size() + 2 * kTilePixels);
    for (std::size_t i = 0; i < looks.size(); ++i) {
      for (const Look& look : looks[i]) {
        if (look.head != h) continue;
        grid.weights[grid.weights.size() - kTilePixels + i] = static_cast<std::int16_t>(-look.weight);
        grid.coordinates[grid.coordinates.size() - 2 * kTilePixels + i] = static_cast<std::uint16_t>(look.x);
        grid.coordinates[grid.coordinates.size() - kTilePixels + i] = static_cast<std::uint16_t>(look.y);
      }
    }
  }
  const auto end = static_cast<std::uint32_t>(grid.records.size());
  grid.tiles.resize(grid.tile_count() + 1, {end, 0});
  table.grids.push_back(std::move(grid));
  return table;
}

/// Draws random tables over `heads` heads of one size: all ways of storing coordinates and of sharing pixels can occur,
/// with all values that a valid table may have.
class RandomTables {
 public:
  explicit RandomTables(std::uint32_t seed) : random_(seed) {}

  std::mt19937& random() { return random_; }
  int below(int n) { return static_cast<int>(random_() % static_cast<unsigned>(n)); }

  BlendTable table(PixelFormat format, PixelFormat head_format, int width, int height, int heads, int head_width,
                   int head_height) {
    BlendTable table;
    table.format = format;
    table.width = width;
    table.height = height;
    table.sources.assign(static_cast<std::size_t>(heads), {head_format, head_width, head_height});
    const bool chroma = has_chroma(format);
    if (is_linear16(format)) {
      for (std::size_t i = 0; i < kLinearSteps; ++i) table.linear.push_back(static_cast<std::uint16_t>(below(65536)));
      std::ranges::sort(table.linear);
      table.linear[0] = 0;
    }
    const bool gains = below(2) == 0;
    table.vignetting_scale = static_cast<std::uint16_t>(gains ? 257 + below(1792) : 256);
    const ImageView head =
        halved_chroma(packed_image(head_format, head_width, head_height, static_cast<const std::uint8_t*>(nullptr)));
    const auto add_grids = [&](std::vector<GridTable>& grids) {
      for (std::size_t g = 0; g < (chroma ? 2U : 1U); ++g) {
        GridTable grid;
        grid.width = g == 0 ? width : (width + 1) / 2;
        grid.height = g == 0 ? height : (height + 1) / 2;
        grid.row_step = g == 0 ? 1 : 2;
        for (std::size_t t = 0; t < grid.tile_count(); ++t) add_tile(grid, heads, head.planes[g], gains);
        grid.tiles.push_back({static_cast<std::uint32_t>(grid.records.size()), 0});
        grids.push_back(std::move(grid));
      }
    };
    add_grids(table.grids);
    if (below(2) == 0) add_grids(table.cover);
    if (below(2) == 0) add_low(table, head, gains);
    if (chroma) table.components = {{{0, 16, 0}, {1, 128, 1}, {1, 128, 1}}};
    if (in_8_bits(format) == PixelFormat::kRgb24) table.components = {{{0, 0, 0}, {0, 0, 1}, {0, 0, 2}}};
    return table;
  }

  /// A random tone that uses some of every feature.
  SetTone tone(const BlendTable& table) {
    SetTone tone = calibrated_tone(table);
    if (below(3) == 0) {
      tone.gains = true;
      for (HeadTone& head : tone.heads) {
        for (auto& gain : head.gain) gain = static_cast<std::uint16_t>(1 + below(kMaxToneGain));
      }
    }
    for (OutputTone& output : tone.output)
      output.scale = static_cast<std::uint16_t>(1 + below(below(2) == 0 ? 512 : 32767));
    if (below(2) == 0) {
      for (HeadTone& head : tone.heads) {
        for (auto& curve : head.curve) {
          if (below(2) == 0) continue;
          curve.emplace();
          for (auto& knot : curve->knots) knot = static_cast<std::int16_t>(below(kMaxSample + 1));
        }
      }
    }
    if (below(3) == 0) {
      tone.output[0].curve.emplace();
      for (auto& knot : tone.output[0].curve->knots) knot = static_cast<std::int16_t>(below(kMaxSample + 1));
    }
    return tone;
  }

 private:
  void add_low(BlendTable& table, const ImageView& head, bool gains) {
    for (auto& source : table.sources) source.low_size = static_cast<std::uint16_t>(16 << below(2));
    for (std::size_t g = 0; g < table.grids.size(); ++g) {
      GridTable& grid = table.grids[g];
      LowGrid& low = grid.low;
      low.cell_tiles = 1 + below(2);
      low.first_point = low.first_sight = {0};
      const int cells = grid.low_cells_across() * grid.low_cells_down();
      for (std::size_t block = 0; block < grid.block_count(); ++block) {
        const int points = 1 + below(static_cast<int>(GridTable::kMaxLowPoints));
        for (int p = 0; p < points; ++p) {
          add_sights(table, g, head.planes[g], gains);
          low.first_sight.push_back(static_cast<std::uint32_t>(low.sights.size()));
        }
        for (int k = 0; k < cells; ++k) {
          auto& corners = low.cells.emplace_back();
          for (auto& corner : corners) corner = static_cast<std::uint8_t>(below(points));
        }
        low.first_point.push_back(static_cast<std::uint32_t>(low.first_sight.size() - 1));
      }
    }
  }

  void add_sights(BlendTable& table, std::size_t g, const PlaneView& plane, bool gains) {
    int left = kOneWeight;
    for (std::size_t h = 0; h < table.sources.size() && left > 0; ++h) {
      if (below(4) == 0 && h + 1 < table.sources.size()) continue;
      const int square = table.sources[h].low_size / (g == 0 ? 1 : 2);
      const auto place = [&](int size) {
        const int last = (std::max(1, size / square) - 1) * 256;
        return static_cast<std::uint16_t>(below(5) == 0 ? last : below(last + 1));
      };
      const bool last = h + 1 == table.sources.size() || below(4) == 0;
      const int weight = last ? left : below(left + 1);
      left -= weight;
      table.grids[g].low.sights.push_back({place(plane.width), place(plane.height), static_cast<std::uint16_t>(weight),
                                           static_cast<std::int16_t>(gains ? 1 + below(32767) : 0),
                                           static_cast<HeadIndex>(h)});
    }
  }

  void add_tile(GridTable& grid, int heads, const PlaneView& plane, bool gains) {
    const auto how = static_cast<Sharing>(below(4));
    const int records = how == Sharing::kAlone ? below(2) : 1 + below(4);
    grid.tiles.push_back({static_cast<std::uint32_t>(grid.records.size()),
                          static_cast<std::uint32_t>(how) << 30 | static_cast<std::uint32_t>(grid.weights.size() / 4)});
    std::array<int, kTilePixels> left;
    left.fill(kOneWeight);
    for (int r = 0; r < records; ++r) {
      const std::size_t made = grid.records.size();
      add_record(grid, heads, plane);
      if (below(3) == 0) make_pair(grid, plane);
      const bool last = r + 1 == records;
      if (how == Sharing::kBilinear && !last) {
        const int most = kOneWeight / records;  // from 0 to most along i, along j, or along both
        const int slope = most / 7 / (1 + below(100)), both = below(most / 49 + 1);
        const std::array<int, 4> ways[] = {{most, 0, 0, 0}, {0, slope, 0, 0}, {most, 0, -slope, 0}, {0, 0, 0, both}};
        for (const int q : ways[below(4)]) grid.weights.push_back(static_cast<std::int16_t>(-q));
      } else if ((how == Sharing::kListed && !last) || how == Sharing::kOpen) {
        for (int& rest : left) {
          const int choice = below(4);
          const bool close = last && how == Sharing::kOpen && rest < kOneWeight;  // no weight where none was before
          const int weight = close || choice == 0 ? rest : last ? 0 : choice == 1 ? 0 : below(rest + 1);
          rest -= weight;
          grid.weights.push_back(static_cast<std::int16_t>(-weight));
        }
      }
      for (std::size_t k = made; k < grid.records.size() && gains; ++k) {
        const auto slope = static_cast<std::int16_t>(below(200));
        grid.gains.push_back({static_cast<std::int16_t>(1500 + below(20000)), slope, static_cast<std::int16_t>(-slope),
                              static_cast<std::int16_t>(below(100))});
      }
    }
  }

  void add_record(GridTable& grid, int heads, const PlaneView& plane) {
    PatchRecord record;
    const auto head = static_cast<HeadIndex>(below(heads));
    record.left = static_cast<std::uint16_t>(below(std::max(1, plane.width - kPatch + 1)));
    record.top = static_cast<std::uint16_t>(below(std::max(1, plane.height - kPatch + 1)));
    const int end_x = std::min(kPatch - 1, plane.width - 1 - record.left) << kFractionBits;
    const int end_y = std::min(kPatch - 1, plane.height - 1 - record.top) << kFractionBits;
    if (below(3) == 0) {
      record.source = PatchRecord::source_of(head, 0, true);
      record.x[0] = static_cast<std::int16_t>(grid.coordinates.size() / (2 * kTilePixels));
      for (const int end : {end_x, end_y}) {
        for (int p = 0; p < kTilePixels; ++p) grid.coordinates.push_back(static_cast<std::uint16_t>(below(end)));
      }
    } else {
      record.source = PatchRecord::source_of(head, 0, false);
      record.x = polynomial(end_x);
      record.y = polynomial(end_y);
      name_rows(record);
    }
    grid.records.push_back(record);
  }

  /// Makes the newest record the first of a pair, the patch of whose second is anywhere that holds the lower half's
  /// samples.
  void make_pair(GridTable& grid, const PlaneView& plane) {
    PatchRecord& upper = grid.records.back();
    PatchRecord lower = upper;
    if (upper.listed()) {
      if (std::min(plane.width, plane.height) >= kPatch) {
        lower.left = static_cast<std::uint16_t>(below(plane.width - kPatch + 1));
        lower.top = static_cast<std::uint16_t>(below(plane.height - kPatch + 1));
      }
    } else {
      const auto move = [&](Quadratic& q, std::uint16_t& start, int size) {
        int least = kPatch, most = 0;
        for (int p = 32; p < 64; ++p) {
          const int sample = (at(q, p % 8, p / 8) & 0xffff) >> kFractionBits;
          least = std::min(least, sample);
          most = std::max(most, sample);
        }
        const int back = std::min<int>(start, kPatch - 2 - most);
        const int on = std::clamp(size - kPatch - start, 0, least);
        const int by = below(back + on + 1) - back;
        q[0] = static_cast<std::int16_t>(static_cast<std::uint16_t>(q[0] - (by << kFractionBits)));
        start = static_cast<std::uint16_t>(start + by);
      };
      move(lower.x, lower.left, plane.width);
      move(lower.y, lower.top, plane.height);
      upper.first = lower.first = {};
      name_rows(upper, 0, 2);
      name_rows(lower, 2, 4);
    }
    upper.first[1] = 0xff;
    lower.first[0] = 0xff;
    grid.records.push_back(lower);
  }

  /// Sets the record's rows: the shortest possible span, or a longer one. Of the quarters from `begin` to `end`.
  void name_rows(PatchRecord& record, int begin = 0, int end = 4) {
    std::array<int, 4> first{kPatch, kPatch, kPatch, kPatch};
    int lowest = 0;
    int span = kMinSpan + below(3);
    for (int quarter = begin; quarter < end; ++quarter) {
      int last = 0;
      for (int p = 0; p < 16; ++p) {
        const int y = (at(record.y, quarter % 2 * 4 + p % 4, quarter / 2 * 4 + p / 4) & 0xffff) >> kFractionBits;
        int& least = first[static_cast<std::size_t>(quarter)];
        least = std::min(least, y);
        last = std::max(last, y);
      }
      span = std::max(span, last - first[static_cast<std::size_t>(quarter)] + 1);
      lowest = std::max(lowest, last);
    }
    for (auto k = static_cast<std::size_t>(begin); k < static_cast<std::size_t>(end); ++k) {
      record.first[k / 2] |= static_cast<std::uint8_t>(std::min(first[k], kPatch - 1 - span) << (k % 2 * 4));
    }
    record.rows = static_cast<std::uint8_t>(lowest | span << 4);
  }

  static int at(const Quadratic& q, int i, int j) {
    return q[0] + q[1] * i + q[2] * j + q[3] * i * j + q[4] * i * i + q[5] * j * j;
  }

  /// A polynomial with values in 0 .. end - 1 over a whole tile.
  Quadratic polynomial(int end) {
    const int room = end - 1;
    Quadratic q{};
    q[1] = static_cast<std::int16_t>(below(room / 21 + 1));
    q[2] = static_cast<std::int16_t>(below(room / 21 + 1));
    for (std::size_t k = 3; k < 6; ++k) q[k] = static_cast<std::int16_t>(below(room / 441 + 1));
    int most = 0;
    for (int j = 0; j < 8; ++j) {
      for (int i = 0; i < 8; ++i) most = std::max(most, at(q, i, j));
    }
    const int start = below(std::max(1, end - most));
    q[0] = static_cast<std::int16_t>(static_cast<std::uint16_t>(start));
    if (below(2) == 0 && start + most < 32768) {  // also falling ones
      q[0] = static_cast<std::int16_t>(start + most);
      for (std::size_t k = 1; k < 6; ++k) q[k] = static_cast<std::int16_t>(-q[k]);
    }
    return q;
  }

  std::mt19937 random_;
};

}  // namespace nodal::blend::test
