// The definition in blend.h, pixel by pixel in wide arithmetic, without any of the kernels' optimizations.
#pragma once

#include <cstdint>
#include <vector>

#include "stitch/blend/blend.h"

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
      if (tone_.gains || !grid.gains.empty()) {
        std::int64_t gain = tone_.heads[share.record->head()].gain[rule.tone];
        if (!grid.gains.empty()) gain = mulr(share.vignetting, gain);
        dark = mulr(dark, gain);
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

  struct Share {
    const PatchRecord* record = nullptr;
    int x = 0, y = 0;  ///< in 1/4096 samples of the patch
    std::int64_t weight = 0;
    std::int64_t vignetting = 0;
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
    const Tile& tile = grid.tiles[grid.tile_index(x / 8, y / 8)];
    const std::size_t count = (&tile + 1)->record - tile.record;
    const int i = x % 8;
    const int j = y % 8;
    std::vector<Share> shares;
    std::int64_t left = 32768;
    bool missing = false;
    for (std::size_t k = 0; k < count; ++k) {
      const std::size_t r = tile.record + k;
      Share share{&grid.records[r]};
      const std::size_t listed = tile.weights() + 64 * k + static_cast<std::size_t>(8 * j + i);
      const bool last = k + 1 == count;
      switch (tile.how()) {
        case Sharing::kAlone: share.weight = left; break;
        case Sharing::kBilinear:
          share.weight = left;
          if (!last) {
            const std::int16_t* q = grid.weights.data() + tile.weights() + 4 * k;
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
      missing = missing || gone(share.record->head());
      shares.push_back(share);
    }
    if (missing || (tone_.confidence && count > 1)) share_again(shares, c);
    return shares;
  }

  void share_again(std::vector<Share>& shares, int c) const {
    std::int64_t sum = 0;
    for (Share& share : shares) {
      if (gone(share.record->head())) share.weight = 0;
      if (share.weight == 0) continue;
      if (tone_.confidence)
        share.weight *= tone_.confidence->of_level[share.record->head()][static_cast<std::size_t>(seen(share, c))];
      sum += share.weight;
    }
    for (Share& share : shares) share.weight = sum == 0 ? 0 : (share.weight * 32768 + sum / 2) / sum;
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
