// The definition in blend.h, pixel by pixel in wide arithmetic, without any of the kernels' optimizations.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstring>
#include <vector>

#include "stitch/blend/blend.h"
#include "stitch/blend/low_picture.h"

namespace nodal::blend::test {

class Definition {
 public:
  Definition(const BlendTable& table, const std::vector<ImageView>& heads, const SetTone& tone)
      : table_(table), heads_(heads), tone_(tone) {}

  /// The level, or the 16-bit number, of component c at (x, y) of its grid.
  int level(int c, int x, int y) const {
    if (!tone_.fade || !has_chroma(table_.format) || c == 0) return blended(c, x, y);
    int luma = 2;
    for (int k = 0; k < 4; ++k) {
      luma += blended(0, std::min(2 * x + k % 2, table_.width - 1), std::min(2 * y + k / 2, table_.height - 1));
    }
    const std::int64_t left = tone_.fade->of_luma[static_cast<std::size_t>(luma / 4)];
    return static_cast<int>(128 + floor_div((blended(c, x, y) - 128) * left + 128, 256));
  }

 private:
  int blended(int c, int x, int y) const {
    const ComponentRule& rule = table_.components[static_cast<std::size_t>(c)];
    const GridTable& grid = table_.grids[rule.grid];
    const std::vector<Share> shares = shares_at(grid, c, x, y);
    std::int64_t light = 0;
    for (const Share& share : shares) {
      if (share.weight == 0) continue;
      std::int64_t dark = 128 * rule.black - curved(share.record->head(), rule.tone, sample(share, c));
      if (tone_.gains || share.vignetting != 0) {
        std::int64_t gain = tone_.heads[share.record->head()].gain[rule.tone];
        if (share.vignetting != 0) gain = mulr(share.vignetting, gain);
        dark = mulr(dark, gain);
      }
      if (!grid.low.cells.empty()) {
        const std::int64_t q = coefficients_at(grid, c, x, y, share.record->head());
        dark = std::clamp<std::int64_t>(dark + mulr(q, 1 << 13), -32640, 32640);
      }
      light += mulr(dark, -share.weight);
    }
    if (is_linear16(table_.format)) return table_.linear[static_cast<std::size_t>(light < 0 ? 0 : light)];
    const OutputTone& output = tone_.output[rule.tone];
    std::int64_t level = rule.black + mulr(light, output.scale);
    if (output.curve) {
      const std::int64_t at = light < 0 ? 0 : light;
      const auto piece = static_cast<std::size_t>(at / 512);
      const std::int64_t knot = output.curve->knots[piece];
      level = floor_div(knot + mulr(output.curve->knots[piece + 1] - knot, 64 * (at % 512)) + 64, 128);
    }
    return static_cast<int>(level < 0 ? 0 : level > 255 ? 255 : level);
  }

  /// Two bands: four times the head's correction at a pixel, as low_band.h defines it.
  std::int64_t coefficients_at(const GridTable& grid, int c, int x, int y, HeadIndex head) const {
    const int side = 8 * grid.low.cell_tiles;
    const int rows = grid.row_step == 1 ? 64 : 32;
    const auto across = static_cast<std::size_t>((grid.width + 63) / 64);
    const std::size_t block = static_cast<std::size_t>(y / rows) * across + static_cast<std::size_t>(x / 64);
    const auto cell = static_cast<std::size_t>(y % rows / side * (64 / side) + x % 64 / side);
    const auto& corners = grid.low.cells[block * static_cast<std::size_t>(64 / side * (rows / side)) + cell];
    std::array<std::int64_t, 4> v{};
    std::array<bool, 4> known{};
    std::int64_t sum = 0, count = 0;
    for (std::size_t k = 0; k < 4; ++k) {
      known[k] = correction(grid, c, grid.low.first_point[block] + corners[k], head, v[k]);
      sum += known[k] ? v[k] : 0;
      count += known[k] ? 1 : 0;
    }
    for (std::size_t k = 0; k < 4; ++k) {
      if (!known[k]) v[k] = count == 0 ? 0 : sum / count;
    }
    // The four coefficients, each rounded from exact fractions; i and j count from the tile's corner.
    const std::int64_t s = side, u = x % side / 8 * 16 + 1, w = y % side / 8 * 16 + 1;  // u, w: in half pixels
    const std::int64_t right = v[1] - v[0], down = v[2] - v[0], both = v[3] - v[2] - right;
    const auto rounded = [](std::int64_t a, std::int64_t b) { return floor_div(2 * a + b, 2 * b); };
    const std::int64_t q0 = rounded(4 * v[0] * s * s + 2 * s * (right * u + down * w) + both * u * w, s * s);
    const std::int64_t q1 = rounded(4 * s * right + 2 * both * w, s * s);
    const std::int64_t q2 = rounded(4 * s * down + 2 * both * u, s * s);
    const std::int64_t q3 = rounded(4 * both, s * s);
    return q0 + q1 * (x % 8) + q2 * (y % 8) + q3 * (x % 8) * (y % 8);
  }

  /// Whether the head has a correction at a point, and which.
  bool correction(const GridTable& grid, int c, std::size_t point, HeadIndex head, std::int64_t& value) const {
    std::int64_t sum = 0, weights = 0, own = 0, own_trust = 0;
    bool seen = false;
    const std::size_t first = grid.low.first_sight[point], last = grid.low.first_sight[point + 1];
    for (std::size_t k = first; k < last; ++k) {
      const LowSight& sight = grid.low.sights[k];
      if (last - first == 1 && sight.head == head) {
        value = 0;
        return true;
      }
      if (gone(sight.head)) continue;
      const std::int64_t light = low_light(grid, c, sight);
      const std::int64_t trust = low_confidence(sight);
      sum += sight.weight * trust * light;
      weights += sight.weight * trust;
      if (sight.head != head) continue;
      seen = true;
      own = light;
      own_trust = trust;
    }
    if (!seen || weights == 0) return false;
    value = std::clamp<std::int64_t>(floor_div(2 * sum + weights, 2 * weights) - own, -8160, 8160) * own_trust / 255;
    return true;
  }

  const ImageView& low_of(HeadIndex head) const {
    return heads_[table_.sources[head].levels * table_.sources.size() + head];
  }
  static LowSample low_at(const PlaneView& plane, int x, int y) {
    x = std::min(x, plane.width - 1);
    y = std::min(y, plane.height - 1);
    LowSample sample;
    std::memcpy(&sample, plane.data + y * plane.row_stride + x * plane.pixel_stride, sizeof sample);
    return sample;
  }
  std::int64_t low_confidence(const LowSight& sight) const {
    if (!tone_.confidence) return 255;
    std::int64_t trust = 255;
    int least = 255, most = 0;
    for (std::size_t c = 0; c < (in_8_bits(table_.format) == PixelFormat::kRgb24 ? 3U : 1U); ++c) {
      for (int k = 0; k < 4; ++k) {
        const LowSample sample = low_at(low_of(sight.head).planes[c], sight.x / 256 + k % 2, sight.y / 256 + k / 2);
        least = std::min<int>(least, sample.least);
        most = std::max<int>(most, sample.most);
      }
    }
    for (const int level : {least, most}) {
      trust = std::min<std::int64_t>(trust, tone_.confidence->of_level[sight.head][static_cast<std::size_t>(level)]);
    }
    return trust;
  }
  std::int64_t low_light(const GridTable& grid, int c, const LowSight& sight) const {
    const ComponentRule& rule = table_.components[static_cast<std::size_t>(c)];
    const PlaneView& plane = low_of(sight.head).planes[static_cast<std::size_t>(c)];
    std::int64_t sum = 0;
    for (int k = 0; k < 4; ++k) {
      const std::int64_t f = k % 2 == 0 ? 256 - sight.x % 256 : sight.x % 256;
      const std::int64_t g = k / 2 == 0 ? 256 - sight.y % 256 : sight.y % 256;
      sum += f * g * low_at(plane, sight.x / 256 + k % 2, sight.y / 256 + k / 2).mean;
    }
    std::int64_t dark = 128 * rule.black - curved(sight.head, rule.tone, static_cast<int>((sum + 32768) / 65536));
    if (tone_.gains || !grid.gains.empty()) {
      std::int64_t gain = tone_.heads[sight.head].gain[rule.tone];
      if (sight.gain != 0) gain = mulr(sight.gain, gain);
      dark = mulr(dark, gain);
    }
    return dark;
  }

  struct Share {
    const PatchRecord* record = nullptr;
    int x = 0, y = 0;  ///< position in the patch, in 1/4096 samples
    std::int64_t weight = 0;
    std::int64_t vignetting = 0;  ///< 0: the table has none
  };

  static std::int64_t floor_div(std::int64_t a, std::int64_t b) { return a / b - (a % b < 0 ? 1 : 0); }
  static std::int64_t mulr(std::int64_t a, std::int64_t b) { return floor_div(a * b + 16384, 32768); }
  template <class Q>
  static int polynomial(const Q& q, int i, int j) {
    const int terms[] = {1, i, j, i * j, i * i, j * j};
    int sum = 0;
    for (std::size_t k = 0; k < q.size(); ++k) sum += q[k] * terms[k];
    return sum;
  }

  /// The contribution of every record to a pixel, with weights corrected for missing heads and confidence.
  std::vector<Share> shares_at(const GridTable& grid, int c, int x, int y) const {
    std::vector<Share> own = shares_in(grid, x, y);
    std::vector<Share> cover;
    if (!table_.cover.empty())
      cover = shares_in(table_.cover[static_cast<std::size_t>(&grid - table_.grids.data())], x, y);
    bool missing = false;
    for (const Share& share : own) missing = missing || gone(share.record->head());
    if (!missing && !(tone_.confidence && (own.size() > 1 || cover.size() > 1))) return own;
    const std::int64_t most = tone_.confidence ? 255 : 1;
    std::int64_t whole = 0, sum = 0, sum_of_cover = 0;
    for (const Share& share : own) whole += most * share.weight;
    for (Share& share : own) sum += share.weight *= trusted(share, c);
    for (Share& share : cover) sum_of_cover += share.weight *= trusted(share, c);
    const std::int64_t lacking = whole - sum;
    const bool covered = whole > 0 && lacking > 0 && sum_of_cover > 0;
    for (Share& share : own) share.weight = part(share.weight, covered ? whole : sum);
    if (!covered) return own;
    for (Share& share : cover) {
      share.weight = part(share.weight * lacking, whole * sum_of_cover);
      own.push_back(share);
    }
    return own;
  }

  /// a / b in 1/32768, rounded half up.
  static std::int64_t part(std::int64_t a, std::int64_t b) { return a == 0 ? 0 : (a * 32768 + b / 2) / b; }

  std::vector<Share> shares_in(const GridTable& grid, int x, int y) const {
    const Tile& tile = grid.tiles[grid.tile_index(x / 8, y / 8)];
    const std::size_t count = (&tile + 1)->record - tile.record;
    const int i = x % 8;
    const int j = y % 8;
    std::vector<Share> shares;
    std::int64_t left = 32768;
    for (std::size_t k = 0, number = 0; k < count; ++k, ++number) {
      const bool pair = grid.records[tile.record + k].first[1] == 0xff;
      const bool last = k + (pair ? 2 : 1) == count;
      if (pair && j >= 4) ++k;
      const std::size_t r = tile.record + k;
      if (pair && j < 4) ++k;
      Share share{&grid.records[r]};
      const std::size_t listed = tile.weights() + 64 * number + static_cast<std::size_t>(8 * j + i);
      switch (tile.how()) {
        case Sharing::kAlone: share.weight = left; break;
        case Sharing::kBilinear:
          share.weight = left;
          if (!last) {
            const std::int16_t* q = grid.weights.data() + tile.weights() + 4 * number;
            share.weight = -polynomial(std::array<int, 4>{q[0], q[1], q[2], q[3]}, i, j);
          }
          break;
        case Sharing::kListed: share.weight = last ? left : -grid.weights[listed]; break;
        case Sharing::kOpen: share.weight = -grid.weights[listed]; break;
      }
      left -= share.weight;
      if (share.record->listed()) {
        share.x = grid.coordinates[share.record->list() * 128 + static_cast<std::size_t>(8 * j + i)];
        share.y = grid.coordinates[share.record->list() * 128 + 64 + static_cast<std::size_t>(8 * j + i)];
      } else {
        share.x = polynomial(share.record->x, i, j) & 0xffff;
        share.y = polynomial(share.record->y, i, j) & 0xffff;
      }
      if (!grid.gains.empty()) share.vignetting = polynomial(grid.gains[r], i, j);
      shares.push_back(share);
    }
    return shares;
  }

  /// 0 for a missing head, else the confidence in it, or 1 if none is set.
  std::int64_t trusted(const Share& share, int c) const {
    if (gone(share.record->head()) || share.weight == 0) return 0;
    if (!tone_.confidence) return 1;
    return tone_.confidence->of_level[share.record->head()][static_cast<std::size_t>(seen(share, c))];
  }

  bool gone(HeadIndex head) const { return heads_[head].planes[0].data == nullptr; }

  /// The level by which confidence is looked up.
  int seen(const Share& share, int c) const {
    if (in_8_bits(table_.format) == PixelFormat::kRgb24) {
      int level = 0;
      for (int k = 0; k < 3; ++k) level = std::max(level, sample(share, k) / 128);
      return level;
    }
    if (c == 0) return sample(share, 0) / 128;
    const ImageView& head = heads_[share.record->head()];
    const PlaneView& luma = head.planes[0];
    const PlaneGrid plane_grid = halved_chroma_grid(head.format, 1, component_grid(head.format, 1));
    const int x = std::min((share.record->left + share.x / 4096) * plane_grid.step_x, luma.width - 1);
    const int y = std::min((share.record->top + share.y / 4096) * plane_grid.step_y, luma.height - 1);
    return luma.data[y * luma.row_stride + x * luma.pixel_stride];
  }

  int sample(const Share& share, int c) const {
    const PlaneView plane = halved_chroma(heads_[share.record->head()]).planes[static_cast<std::size_t>(c)];
    const auto s = [&](int dx, int dy) {
      const int x = share.record->left + share.x / 4096 + dx;
      const int y = share.record->top + share.y / 4096 + dy;
      return std::int64_t{plane.data[y * plane.row_stride + x * plane.pixel_stride]};
    };
    const int f = share.x % 4096 / 32;
    const std::int64_t top = s(0, 0) * (128 - f) + s(1, 0) * f;
    const std::int64_t bottom = s(0, 1) * (128 - f) + s(1, 1) * f;
    return static_cast<int>(top - mulr(top - bottom, 8 * (share.y % 4096)));
  }

  std::int64_t curved(HeadIndex head, std::size_t tone, int sample) const {
    const auto& curve = tone_.heads[head].curve[tone];
    if (!curve) return sample;
    const auto piece = static_cast<std::size_t>(sample / 1024);
    const std::int64_t knot = curve->knots[piece];
    return knot + mulr(curve->knots[piece + 1] - knot, 32 * (sample % 1024));
  }

  const BlendTable& table_;
  const std::vector<ImageView>& heads_;
  const SetTone& tone_;
};

}  // namespace nodal::blend::test
