#include "stitch/decode/yuv411.h"

#include "protocol/base/result.h"
#include "stitch/blend/clones.h"
#include "stitch/decode/recode.h"

namespace nodal::decode {
namespace {

struct YuvRow {
  std::uint8_t* y;
  std::uint8_t* u;
  std::uint8_t* v;
};

/// Whole groups of four pixels, each of which has a group after it.
NODAL_CLONES void unpack_groups(const std::uint8_t* __restrict from, YuvRow to, int groups) {
  std::uint8_t* __restrict const y = to.y;
  std::uint8_t* __restrict const u = to.u;
  std::uint8_t* __restrict const v = to.v;
  for (int k = 0; k < groups; ++k) {
    const std::uint8_t* const group = from + 6 * k;
    y[4 * k] = group[1];
    y[4 * k + 1] = group[2];
    y[4 * k + 2] = group[4];
    y[4 * k + 3] = group[5];
    u[2 * k] = group[0];
    u[2 * k + 1] = static_cast<std::uint8_t>((group[0] + group[6] + 1) >> 1);
    v[2 * k] = group[3];
    v[2 * k + 1] = static_cast<std::uint8_t>((group[3] + group[9] + 1) >> 1);
  }
}

/// The last group of a row, of `pixels` pixels (1 to 4).
void unpack_last(const std::uint8_t* group, YuvRow to, int pixels) {
  constexpr int kLuma[4] = {1, 2, 4, 5};
  for (int i = 0; i < pixels; ++i) to.y[i] = group[kLuma[i]];
  for (int i = 0; i < (pixels + 1) / 2; ++i) {
    to.u[i] = group[0];
    to.v[i] = group[3];
  }
}

}  // namespace

void unpack_411(const ImageView& from, const MutableImageView& into) {
  NODAL_ASSERT(into.format == PixelFormat::kI422 && into.width == from.width && into.height == from.height);
  const int groups = (from.width - 1) / 4;
  for (int y = 0; y < from.height; ++y) {
    const auto row = [&](std::size_t c) { return into.planes[c].data + y * into.planes[c].row_stride; };
    const std::uint8_t* const packed = from.planes[0].data + y * from.planes[0].row_stride;
    unpack_groups(packed, {row(0), row(1), row(2)}, groups);
    unpack_last(packed + std::ptrdiff_t{6} * groups, {row(0) + 4 * groups, row(1) + 2 * groups, row(2) + 2 * groups},
                from.width - 4 * groups);
  }
  if (from.coding == ColourCoding{}) return;
  ImageView unpacked{into.format, into.width, into.height, {}, into.bytes, from.coding};
  for (std::size_t c = 0; c < kMaxPlanes; ++c) {
    const MutablePlaneView& plane = into.planes[c];
    unpacked.planes[c] = {plane.data, plane.width, plane.height, plane.row_stride, plane.pixel_stride};
  }
  recode(unpacked, into);
}

}  // namespace nodal::decode
