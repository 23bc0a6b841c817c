#include "stitch/table/patch_fit.h"

#include <algorithm>

namespace nodal::table {
namespace {

using blend::kFractionBits;
using blend::kPatch;
using blend::PatchRecord;

/// Half of the last of the 7 fraction bits that the blend uses of x coordinates: added, so that truncation rounds.
constexpr std::int32_t kAcross = 1 << (kFractionBits - 8);

/// The largest start of a patch that holds the samples least .. most and the next one, in a plane of `size`; negative
/// if no patch can. `slack` is the tolerance of the fit.
int patch_start(Span span, int size, int slack) {
  const int first = std::max(0, (span.least - slack) >> kFractionBits);
  const int last = std::min(size - 2, (span.most + slack) >> kFractionBits);
  if (last + 1 - first > kPatch - 1) return -1;
  return std::max(0, std::min(first, size - kPatch));
}

/// The same for columns. Prefers a multiple of 16 (each row of the patch is then in one cache line if the stride is a
/// multiple of 16), then a start for which that holds if the picture's rows begin at cache lines.
int patch_left(Span span, int size, int slack) {
  const int most = patch_start(span, size, slack);
  if (most < 0) return most;
  const int last = std::min(size - 2, (span.most + slack) >> kFractionBits);
  const int least = std::max(0, last + 1 - (kPatch - 1));
  if (most / 16 * 16 >= least) return most / 16 * 16;
  for (int left = most; left >= least; --left) {
    if (left % 64 <= 48) return left;
  }
  return most;
}

using Masks = std::span<const PixelMask>;
/// By record: the first sample of its patch along one direction.
using Starts = std::array<int, 2>;

PixelMask all_of(Masks masks) { return masks.front() | masks.back(); }

template <class StartOf>
Starts starts_of(const PixelValues& values, Masks masks, int size, int slack, StartOf start_of) {
  Starts starts{};
  for (std::size_t k = 0; k < masks.size(); ++k) starts[k] = start_of(span_of(values, masks[k]), size, slack);
  return starts;
}
bool found(const Starts& starts) { return starts[0] >= 0 && starts[1] >= 0; }

/// Fits the six coefficients of `values` less the first patch's start, and stores them in `out`, modulo 2^16. Returns
/// whether they are within kPatchFit, and inside the patch, for every pixel.
bool fit_coordinate(const PixelValues& values, Masks masks, const Starts& starts, int size, int bias,
                    blend::Quadratic& out) {
  PixelValues local{};
  for_each(all_of(masks), [&](std::size_t p) { local[p] = values[p] - (starts[0] << kFractionBits) + bias; });
  const std::array<std::int32_t, 6> fit = fit_quadratic(local, all_of(masks));
  bool good = true;
  for (std::size_t k = 0; k < masks.size(); ++k) {
    const std::int32_t begin = (starts[k] - starts[0]) * (1 << kFractionBits);
    // The next sample is inside.
    const std::int32_t end = begin + (std::min(kPatch - 1, size - 1 - starts[k]) << kFractionBits);
    for_each(masks[k], [&](std::size_t p) {
      const auto i = static_cast<std::int32_t>(p % 8);
      const auto j = static_cast<std::int32_t>(p / 8);
      const std::int32_t at = fit[0] + fit[1] * i + fit[2] * j + fit[3] * i * j + fit[4] * i * i + fit[5] * j * j;
      good = good && std::abs(at - local[p]) <= kPatchFit && at >= begin && at < end;
    });
  }
  for (std::size_t k = 0; k < 6; ++k) out[k] = static_cast<std::int16_t>(static_cast<std::uint16_t>(fit[k]));
  return good;
}

/// Appends the coordinates to a list, where fit_coordinate fails.
void list_coordinate(const PixelValues& values, Masks masks, const Starts& starts, int size, int bias,
                     std::vector<std::uint16_t>& list) {
  const std::size_t at = list.size();
  list.resize(at + blend::kTilePixels);
  for (std::size_t k = 0; k < masks.size(); ++k) {
    const std::int32_t end = std::min(kPatch - 1, size - 1 - starts[k]) << kFractionBits;
    for_each(masks[k], [&](std::size_t p) {
      const std::int32_t local = values[p] - (starts[k] << kFractionBits) + bias;
      list[at + p] = static_cast<std::uint16_t>(std::clamp(local, 0, end - 1));
    });
  }
}

/// Computes which rows of its patch a record's pixels read (PatchRecord::first, PatchRecord::rows). `paired`: it is one
/// of a pair.
void name_rows(const std::vector<std::uint16_t>& coordinates, PixelMask mask, bool paired, PatchRecord& record) {
  std::array<int, 4> first, last;  // by quarter
  first.fill(kPatch);
  last.fill(-1);
  for_each(mask, [&](std::size_t p) {
    const auto i = static_cast<int>(p % 8);
    const auto j = static_cast<int>(p / 8);
    const blend::Quadratic& q = record.y;
    const int y =
        record.listed()
            ? coordinates[record.list() * 128 + 64 + p]
            : static_cast<std::uint16_t>(q[0] + q[1] * i + q[2] * j + q[3] * i * j + q[4] * i * i + q[5] * j * j);
    const auto quarter = static_cast<std::size_t>(j / blend::kQuarter * 2 + i / blend::kQuarter);
    first[quarter] = std::min(first[quarter], y >> kFractionBits);
    last[quarter] = std::max(last[quarter], y >> kFractionBits);
  });
  int span = blend::kMinSpan;
  for (std::size_t k = 0; k < 4; ++k) span = std::max(span, last[k] - first[k] + 1);
  for (std::size_t half = 0; half < 2; ++half) {
    if (paired && first[2 * half] == kPatch && first[2 * half + 1] == kPatch) {
      record.first[half] = PatchRecord::kOther;
      continue;
    }
    int* starts = first.data() + 2 * half;
    for (std::size_t side = 0; side < 2; ++side) {
      // A quarter without weight takes its neighbour's.
      const int start = starts[side] == kPatch ? starts[1 - side] : starts[side];
      record.first[half] |= static_cast<std::uint8_t>(std::min(start, kPatch - 1 - span) << (side * 4));
    }
  }
  record.rows = static_cast<std::uint8_t>(std::max(0, *std::ranges::max_element(last)) | span << 4);
}

}  // namespace

std::optional<std::array<PatchRecord, 2>> fit_patches(const PixelValues& x, const PixelValues& y, Masks masks,
                                                      int width, int height, std::vector<std::uint16_t>& coordinates) {
  PatchRecord record;
  Starts left = starts_of(x, masks, width, kPatchFit + kAcross, patch_left);
  Starts top = starts_of(y, masks, height, kPatchFit, patch_start);
  if (!found(left) || !found(top) || !fit_coordinate(x, masks, left, width, kAcross, record.x) ||
      !fit_coordinate(y, masks, top, height, 0, record.y)) {
    left = starts_of(x, masks, width, 0, patch_left);
    top = starts_of(y, masks, height, 0, patch_start);
    if (!found(left) || !found(top)) return std::nullopt;
    record.x = record.y = {};
    record.set_list(coordinates.size() / (2 * blend::kTilePixels));
    list_coordinate(x, masks, left, width, kAcross, coordinates);
    list_coordinate(y, masks, top, height, 0, coordinates);
    record.source = PatchRecord::kListed;
  }
  std::array<PatchRecord, 2> records;
  for (std::size_t k = 0; k < masks.size(); ++k) {
    records[k] = record;
    if (!record.listed()) {
      records[k].x[0] = blend::moved(record.x[0], left[k] - left[0]);
      records[k].y[0] = blend::moved(record.y[0], top[k] - top[0]);
    }
    records[k].left = static_cast<std::uint16_t>(left[k]);
    records[k].top = static_cast<std::uint16_t>(top[k]);
    name_rows(coordinates, masks[k], masks.size() == 2, records[k]);
  }
  return records;
}

}  // namespace nodal::table
