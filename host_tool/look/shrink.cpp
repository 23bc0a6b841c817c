#include "host_tool/look/shrink.h"

#include <algorithm>
#include <cmath>
#include <vector>

namespace nodal::host::look {
namespace {

/// A new pixel covers the old ones from `first` on, with these shares, which sum to 1.
struct Cover {
  int first = 0;
  std::vector<float> shares;
};

std::vector<Cover> covers(int from, int to) {
  std::vector<Cover> all;
  const double scale = static_cast<double>(from) / to;
  for (int k = 0; k < to; ++k) {
    const double begin = k * scale, end = std::min<double>(from, (k + 1) * scale);
    Cover cover{static_cast<int>(begin), {}};
    for (int old = cover.first; old < end; ++old)
      cover.shares.push_back(
          static_cast<float>((std::min(old + 1.0, end) - std::max<double>(old, begin)) / (end - begin)));
    all.push_back(std::move(cover));
  }
  return all;
}

}  // namespace

DecodedImage shrunk(const DecodedImage& picture, int side) {
  const int longer = std::max(picture.width, picture.height);
  if (longer <= side) return picture;
  const auto scaled = [&](int length) {
    return std::max(1, static_cast<int>(std::lround(static_cast<double>(length) * side / longer)));
  };
  DecodedImage made{picture.format, scaled(picture.width), scaled(picture.height), {}, picture.meaning, {}};
  const int channels = picture.format == PixelFormat::kGrey8 ? 1 : 3;
  const std::vector<Cover> columns = covers(picture.width, made.width), rows = covers(picture.height, made.height);
  const auto row_bytes = static_cast<std::size_t>(picture.width) * static_cast<std::size_t>(channels);
  std::vector<float> sum(row_bytes);
  made.bytes.reserve(static_cast<std::size_t>(made.width) * static_cast<std::size_t>(made.height * channels));
  for (const Cover& row : rows) {
    std::ranges::fill(sum, 0.0F);
    for (std::size_t r = 0; r < row.shares.size(); ++r) {
      const std::uint8_t* old = picture.bytes.data() + (static_cast<std::size_t>(row.first) + r) * row_bytes;
      for (std::size_t x = 0; x < row_bytes; ++x) sum[x] += row.shares[r] * old[x];
    }
    for (const Cover& column : columns) {
      for (int c = 0; c < channels; ++c) {
        float level = 0.5F;
        for (std::size_t k = 0; k < column.shares.size(); ++k)
          level +=
              column.shares[k] * sum[(static_cast<std::size_t>(column.first) + k) * static_cast<std::size_t>(channels) +
                                     static_cast<std::size_t>(c)];
        made.bytes.push_back(static_cast<std::uint8_t>(std::min(255.0F, level)));
      }
    }
  }
  return made;
}

}  // namespace nodal::host::look
