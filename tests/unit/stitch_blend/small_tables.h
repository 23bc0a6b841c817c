// Hand-made tables and pictures, small enough to work out on paper.
#pragma once

#include <cstdint>
#include <random>
#include <vector>

#include "protocol/base/image.h"
#include "stitch/blend/blend.h"

namespace nodal::blend::test {

/// A picture with its own memory.
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

/// The grey raymap of one row whose sample i has samples[i] as its taps.
inline BlendTable grey_row(const std::vector<std::vector<Tap>>& samples, int heads, int head_width, int head_height) {
  BlendTable table;
  table.format = PixelFormat::kGrey8;
  table.width = static_cast<int>(samples.size());
  table.height = 1;
  table.sources.assign(static_cast<std::size_t>(heads), {PixelFormat::kGrey8, head_width, head_height});
  GridTable grid{table.width, 1, 1, {0}, {}};
  for (const std::vector<Tap>& taps : samples) {
    grid.taps.insert(grid.taps.end(), taps.begin(), taps.end());
    grid.first.push_back(static_cast<std::uint32_t>(grid.taps.size()));
  }
  table.grids.push_back(std::move(grid));
  return table;
}

inline constexpr std::uint16_t kOneGain = 1 << kGainBits;
inline constexpr std::uint16_t kOneWeight = 1 << kWeightBits;
inline constexpr std::uint16_t kHalf = 1 << (kFractionBits - 1);

/// A table over `heads` heads of head_width x head_height with up to three random taps a sample, some samples
/// without any. Every value a validated table may have can appear.
inline BlendTable random_table(std::mt19937& random, PixelFormat format, PixelFormat head_format, int width,
                               int height, int heads, int head_width, int head_height, bool with_gains) {
  const auto below = [&](int n) { return static_cast<int>(random() % static_cast<unsigned>(n)); };
  BlendTable table;
  table.format = format;
  table.width = width;
  table.height = height;
  table.sources.assign(static_cast<std::size_t>(heads), {head_format, head_width, head_height});
  if (with_gains) {
    for (auto& source : table.sources) {
      for (auto& gain : source.gain) gain = static_cast<std::uint16_t>(1 + below(kMaxGain));
      source.sharpen = static_cast<std::uint8_t>(below(3) == 0 ? 0 : below(kMaxSharpen + 1));
    }
  }
  const bool chroma = format == PixelFormat::kI420;
  const ImageView head = packed_image(head_format, head_width, head_height, static_cast<const std::uint8_t*>(nullptr));
  for (std::size_t g = 0; g < (chroma ? 2U : 1U); ++g) {
    GridTable grid{g == 0 ? width : (width + 1) / 2, g == 0 ? height : (height + 1) / 2, g == 0 ? 1 : 2, {0}, {}};
    for (int s = 0; s < grid.width * grid.height; ++s) {
      int left = kOneWeight;
      for (int n = below(4); n > 0; --n) {
        const int weight = n == 1 ? left : 1 + below(left - n);
        left -= weight;
        grid.taps.push_back({static_cast<std::uint16_t>(below(head.planes[g].width - 1)),
                             static_cast<std::uint16_t>(below(head.planes[g].height - 1)),
                             static_cast<std::uint16_t>(below(1 << kFractionBits)),
                             static_cast<std::uint16_t>(below(1 << kFractionBits)),
                             static_cast<std::uint16_t>(weight),
                             static_cast<std::uint16_t>(with_gains ? 1 + below(kMaxGain) : kOneGain),
                             static_cast<HeadIndex>(below(heads)), 0});
      }
      grid.first.push_back(static_cast<std::uint32_t>(grid.taps.size()));
    }
    table.grids.push_back(std::move(grid));
  }
  if (chroma) table.components = {{{0, 16, 1}, {1, 128, 1}, {1, 128, 1}}};
  if (format == PixelFormat::kRgb24) table.components = {{{0, 0, 0}, {0, 0, 1}, {0, 0, 2}}};
  return table;
}

inline Picture noise(std::mt19937& random, PixelFormat format, int width, int height) {
  Picture picture(format, width, height);
  for (auto& byte : picture.bytes) byte = static_cast<std::uint8_t>(random());
  return picture;
}

}  // namespace nodal::blend::test
