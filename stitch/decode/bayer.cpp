#include "stitch/decode/bayer.h"

#include <algorithm>
#include <array>
#include <vector>

#include "protocol/base/result.h"
#include "stitch/blend/clones.h"

namespace nodal::decode {
namespace {

constexpr int kReach = 2;  ///< samples that the filters reach to each side
constexpr int kRows = 2 * kReach + 1;

[[gnu::always_inline]] inline std::uint8_t level(int sixteenths) {
  return static_cast<std::uint8_t>(std::clamp((sixteenths + 8) >> 4, 0, 255));
}

/// The rows from two above to two below the current one, each with two mirrored samples on either side.
using Window = std::array<const std::uint8_t*, kRows>;

/// One row in full colour. `own` is the colour that the row's mosaic has beside green, `cross` the third one.
struct ColourRow {
  std::uint8_t* own;
  std::uint8_t* green;
  std::uint8_t* cross;
};

/// `first`: 0 if the row's own colour is at even pixels, else 1. The filters are those of the source, in sixteenths.
NODAL_CLONES void interpolate_row(const Window& rows, ColourRow out, int width, int first) {
  const std::uint8_t* const uu = rows[0] + kReach;
  const std::uint8_t* const u = rows[1] + kReach;
  const std::uint8_t* const c = rows[2] + kReach;
  const std::uint8_t* const d = rows[3] + kReach;
  const std::uint8_t* const dd = rows[4] + kReach;
  for (int x = 0; x < width; ++x) {
    const int here = c[x];
    const int beside = c[x - 1] + c[x + 1];
    const int upright = u[x] + d[x];
    const int corners = u[x - 1] + u[x + 1] + d[x - 1] + d[x + 1];
    const int far_beside = c[x - 2] + c[x + 2];
    const int far_upright = uu[x] + dd[x];
    const bool at_own = (x & 1) == first;
    const std::uint8_t green = level(8 * here + 4 * (beside + upright) - 2 * (far_beside + far_upright));
    const std::uint8_t opposite = level(12 * here + 4 * corners - 3 * (far_beside + far_upright));
    const std::uint8_t from_beside = level(10 * here + 8 * beside - 2 * (corners + far_beside) + far_upright);
    const std::uint8_t from_upright = level(10 * here + 8 * upright - 2 * (corners + far_upright) + far_beside);
    const auto same = static_cast<std::uint8_t>(here);
    out.own[x] = at_own ? same : from_beside;
    out.green[x] = at_own ? green : same;
    out.cross[x] = at_own ? opposite : from_upright;
  }
}

/// Full range BT.601 in 1 / 2^16 (JFIF 1.02); each row of coefficients sums to one or to zero.
constexpr int kBits = 16;
constexpr int kHalf = 1 << (kBits - 1);
[[gnu::always_inline]] inline int luma(int r, int g, int b) { return 19595 * r + 38470 * g + 7471 * b; }

struct RgbRow {
  const std::uint8_t* r;
  const std::uint8_t* g;
  const std::uint8_t* b;
};

NODAL_CLONES void write_luma(RgbRow row, std::uint8_t* out, int width) {
  for (int x = 0; x < width; ++x) {
    out[x] = static_cast<std::uint8_t>((luma(row.r[x], row.g[x], row.b[x]) + kHalf) >> kBits);
  }
}

/// The chroma of the mean of four pixels: those at x and `right` of two rows.
[[gnu::always_inline]] inline void chroma_sample(RgbRow upper, RgbRow lower, int x, int right, std::uint8_t* u,
                                                 std::uint8_t* v) {
  constexpr int kOffset = (128 << (kBits + 2)) + (1 << (kBits + 1));
  const int r = upper.r[x] + upper.r[right] + lower.r[x] + lower.r[right];
  const int g = upper.g[x] + upper.g[right] + lower.g[x] + lower.g[right];
  const int b = upper.b[x] + upper.b[right] + lower.b[x] + lower.b[right];
  *u = static_cast<std::uint8_t>(std::min((-11059 * r - 21709 * g + 32768 * b + kOffset) >> (kBits + 2), 255));
  *v = static_cast<std::uint8_t>(std::min((32768 * r - 27439 * g - 5329 * b + kOffset) >> (kBits + 2), 255));
}

/// Chroma of 2 x 2 pixels each; the last column is repeated where the width is odd.
NODAL_CLONES void write_chroma(RgbRow upper, RgbRow lower, std::uint8_t* u, std::uint8_t* v, int width) {
  for (int i = 0; i < width / 2; ++i) chroma_sample(upper, lower, 2 * i, 2 * i + 1, u + i, v + i);
  if (width % 2 != 0) chroma_sample(upper, lower, width - 1, width - 1, u + width / 2, v + width / 2);
}

int mirrored(int at, int count) { return at < 0 ? -at : at >= count ? 2 * (count - 1) - at : at; }

/// Reads the mosaic row by row, and holds what the filters and the conversion need.
class Rows {
 public:
  Rows(const ImageView& mosaic, std::vector<std::uint8_t>& memory)
      : plane_(mosaic.planes[0]),
        first_row_is_red_(mosaic.format == PixelFormat::kRggb8 || mosaic.format == PixelFormat::kGrbg8),
        own_first_(mosaic.format == PixelFormat::kRggb8 || mosaic.format == PixelFormat::kBggr8 ? 0 : 1),
        stride_(static_cast<std::size_t>(plane_.width) + 2 * kReach) {
    memory.resize(stride_ * kRows + static_cast<std::size_t>(plane_.width) * 3 * 2);
    padded_ = memory.data();
    colours_ = padded_ + stride_ * kRows;
    for (int y = -kReach; y < kReach; ++y) pad(y);
  }

  /// Row y in full colour; to be called for 0, 1, 2 and so on. It stays until the row after the next one is asked for.
  RgbRow row(int y) {
    pad(y + kReach);
    const auto width = static_cast<std::size_t>(plane_.width);
    std::uint8_t* const memory = colours_ + static_cast<std::size_t>(y % 2) * 3 * width;
    const ColourRow out{memory, memory + width, memory + 2 * width};
    Window window;
    for (int k = 0; k < kRows; ++k) window[static_cast<std::size_t>(k)] = padded(y + k - kReach);
    interpolate_row(window, out, plane_.width, y % 2 == 0 ? own_first_ : 1 - own_first_);
    const bool red = (y % 2 == 0) == first_row_is_red_;
    return {red ? out.own : out.cross, out.green, red ? out.cross : out.own};
  }

 private:
  std::uint8_t* padded(int y) { return padded_ + static_cast<std::size_t>((y + kRows) % kRows) * stride_; }
  void pad(int y) {
    const std::uint8_t* const from = plane_.data + mirrored(y, plane_.height) * plane_.row_stride;
    std::uint8_t* const to = padded(y);
    std::copy_n(from, plane_.width, to + kReach);
    for (int k = 1; k <= kReach; ++k) {
      to[kReach - k] = from[k];
      to[kReach + plane_.width - 1 + k] = from[plane_.width - 1 - k];
    }
  }

  const PlaneView plane_;
  const bool first_row_is_red_;
  const int own_first_;
  const std::size_t stride_;
  std::uint8_t* padded_ = nullptr;   // kRows rows, used in turns
  std::uint8_t* colours_ = nullptr;  // two rows of three colours
};

void write_rgb(RgbRow row, std::uint8_t* out, int width) {
  for (int x = 0; x < width; ++x, out += 3) {
    out[0] = row.r[x];
    out[1] = row.g[x];
    out[2] = row.b[x];
  }
}

}  // namespace

void demosaic(const ImageView& mosaic, const MutableImageView& into, std::vector<std::uint8_t>& memory) {
  NODAL_ASSERT(mosaic.width >= 4 && mosaic.height >= 4);
  Rows rows(mosaic, memory);
  RgbRow above{};
  for (int y = 0; y < mosaic.height; ++y) {
    const RgbRow row = rows.row(y);
    std::uint8_t* const out = into.planes[0].data + y * into.planes[0].row_stride;
    if (into.format == PixelFormat::kRgb24) {
      write_rgb(row, out, mosaic.width);
      continue;
    }
    write_luma(row, out, mosaic.width);
    if (into.format == PixelFormat::kGrey8) continue;
    if (y % 2 == 0 && y + 1 < mosaic.height) {
      above = row;
      continue;
    }
    const std::ptrdiff_t half = y / 2;
    write_chroma(y % 2 == 0 ? row : above, row, into.planes[1].data + half * into.planes[1].row_stride,
                 into.planes[2].data + half * into.planes[2].row_stride, mosaic.width);
  }
}

}  // namespace nodal::decode
