#include "stitch/table/tile_builder.h"

#include <algorithm>

#include "stitch/table/patch_fit.h"
#include "stitch/table/quantize.h"

namespace nodal::table {
namespace {

using blend::PatchRecord;
using blend::Sharing;

constexpr std::int32_t kWhole = 1 << blend::kWeightBits;
constexpr PixelMask kUpperHalf = 0xffffffff;

}  // namespace

void TileBuilder::append(const TileSamples& samples, TileRun& run) {
  parts_.clear();
  split_by_head(samples);
  append_parts(samples.inside, run);
}

void TileBuilder::append(const ClearTile& tile, TileRun& run) {
  parts_.clear();
  Part& part = parts_.emplace_back();
  part.head = tile.head;
  part.mask = ~PixelMask{0};
  const RaySampler::Plane& plane = sampler_.plane(grid_, tile.head);
  for (std::size_t p = 0; p < blend::kTilePixels; ++p) {
    part.x[p] = quantize_coordinate(tile.x[p], plane.width);
    part.y[p] = quantize_coordinate(tile.y[p], plane.height);
    part.weight[p] = kWhole;
    if (vignetting_scale_ != 0) part.gain[p] = quantize_vignetting(tile.gain[p]);
  }
  append_parts(part.mask, run);
}

void TileBuilder::append_empty(TileRun& run) {
  run.tiles.push_back({static_cast<std::uint32_t>(run.records.size()), 0});
}

void TileBuilder::append_parts(PixelMask inside, TileRun& run) {
  made_.clear();
  append_empty(run);
  choose_levels();
  for (std::size_t k = 0; k < parts_.size(); ++k) add_patches(k, parts_[k].mask, {}, run);
  share(inside, run);
}

std::int32_t TileBuilder::quantize_vignetting(double gain) const {
  return static_cast<std::int32_t>(
      std::clamp<std::int64_t>(round_up_ties(gain * (256.0 * 32768 / vignetting_scale_)), 1, 32767));
}

/// Converts samples by pixel to integers by head. Heads whose weight is below kWeightFit everywhere in the tile are
/// left out, unless a pixel has no other head.
void TileBuilder::split_by_head(const TileSamples& samples) {
  std::array<double, kMaxHeads> most{};
  std::array<bool, kMaxHeads> needed{};
  for_each(samples.inside, [&](std::size_t p) {
    for (const RaySample& s : samples.at[p]) {
      most[s.head] = std::max(most[s.head], s.weight);
      needed[s.head] = needed[s.head] || samples.at[p].size() == 1;
    }
  });
  // Between two integers, so that the result does not depend on rounding.
  const double least = (kWeightFit + 0.5) / kWhole;
  std::array<int, kMaxHeads> part_of;
  part_of.fill(-1);
  std::vector<RaySample> kept;
  std::array<std::uint16_t, kMaxHeads> weights;
  for_each(samples.inside, [&](std::size_t p) {
    const std::vector<RaySample>& all = samples.at[p];
    kept.clear();
    double sum = 0;
    for (const RaySample& s : all) {
      if (!needed[s.head] && most[s.head] < least) continue;
      kept.push_back(s);
      sum += s.weight;
    }
    if (kept.empty() || !(sum > 0.5)) kept = all;  // only heads with small weights see this pixel: keep them
    else if (kept.size() < all.size())
      for (RaySample& s : kept) s.weight /= sum;
    if (kept.empty()) return;
    share_out(kept, weights);
    for (std::size_t k = 0; k < kept.size(); ++k) {
      if (weights[k] == 0) continue;
      const RaySample& s = kept[k];
      if (part_of[s.head] < 0) {
        part_of[s.head] = static_cast<int>(parts_.size());
        parts_.emplace_back().head = s.head;
      }
      Part& part = parts_[static_cast<std::size_t>(part_of[s.head])];
      const RaySampler::Plane& plane = sampler_.plane(grid_, s.head);
      part.mask |= PixelMask{1} << p;
      part.x[p] = quantize_coordinate(s.x, plane.width);
      part.y[p] = quantize_coordinate(s.y, plane.height);
      part.weight[p] = weights[k];
      if (vignetting_scale_ != 0) part.gain[p] = quantize_vignetting(s.gain);
    }
  });
  std::sort(parts_.begin(), parts_.end(), [](const Part& a, const Part& b) { return a.head < b.head; });
}

/// Adds the patches for those of the part's pixels `of` that are in a block. If one patch does not suffice, the pixels
/// are separated where they jump to another place in the head's picture, over an edge of the layout. Without a jump, a
/// pair of patches is tried, and then the block is halved, across or down, whichever leaves the smaller spans of
/// coordinates.
void TileBuilder::add_patches(std::size_t k, PixelMask of, const Block& block, TileRun& run) {
  const Part& part = parts_[k];
  const PixelMask mask = of & block_mask(block);
  if (mask == 0) return;
  const int columns = block.right - block.left;
  const int rows = block.bottom - block.top;
  if (add_records(part, {&mask, 1}, columns * rows == 1, run)) {
    made_.push_back({k, mask});
    return;
  }
  if (const PixelMask near = before_jump(part, mask); near != mask) {
    add_patches(k, near, block, run);
    add_patches(k, mask & ~near, block, run);
    return;
  }
  const std::array<PixelMask, 2> halves{mask & kUpperHalf, mask & ~kUpperHalf};
  if (rows == blend::kTile && columns == blend::kTile && halves[0] != 0 && halves[1] != 0 &&
      add_records(part, halves, false, run)) {
    made_.push_back({k, mask});
    return;
  }
  Block west = block, east = block, north = block, south = block;
  west.right = east.left = block.left + columns / 2;
  north.bottom = south.top = block.top + rows / 2;
  const auto widest = [&](const Block& a, const Block& b) {
    std::int32_t most = 0;
    for (const PixelMask half : {mask & block_mask(a), mask & block_mask(b)}) {
      if (half == 0) continue;
      for (const PixelValues* values : {&part.x, &part.y}) {
        const Span span = span_of(*values, half);
        most = std::max(most, span.most - span.least);
      }
    }
    return most;
  };
  const bool across = rows == 1 || (columns > 1 && widest(west, east) < widest(north, south));
  add_patches(k, of, across ? west : north, run);
  add_patches(k, of, across ? east : south, run);
}

/// The pixels of the mask on this side of the largest step between their sorted x or y coordinates; the whole mask if
/// no step is above kJump.
PixelMask TileBuilder::before_jump(const Part& part, PixelMask mask) {
  std::int32_t largest = kJump;
  PixelMask before = mask;
  for (const PixelValues* values : {&part.x, &part.y}) {
    std::array<std::int32_t, blend::kTilePixels> sorted;
    auto end = sorted.begin();
    for_each(mask, [&](std::size_t p) { *end++ = (*values)[p]; });
    std::sort(sorted.begin(), end);
    for (auto at = sorted.begin(); at + 1 < end; ++at) {
      if (at[1] - at[0] <= largest) continue;
      largest = at[1] - at[0];
      before = 0;
      for_each(mask, [&](std::size_t p) { before |= (*values)[p] <= *at ? PixelMask{1} << p : 0; });
    }
  }
  return before;
}

/// Fits the gains of a record's pixels. With `must` there is always a result (for a single pixel).
std::optional<std::array<std::int16_t, 4>> TileBuilder::fit_gain(const Part& part, PixelMask mask, bool must) const {
  const std::array<std::int32_t, 4> fit = fit_bilinear(part.gain, mask);
  const int within = sampler_.layout().scattered() ? kGainFitOfRays : kGainFit;
  bool good = true;
  for_each(mask, [&](std::size_t p) {
    const auto i = static_cast<std::int32_t>(p % 8);
    const auto j = static_cast<std::int32_t>(p / 8);
    const std::int32_t at = fit[0] + fit[1] * i + fit[2] * j + fit[3] * i * j;
    good = good && std::abs(at - part.gain[p]) <= within && at >= 1 && at <= 32767;
  });
  for (std::size_t k = 0; k < 4; ++k) good = good && std::abs(fit[k]) <= 32767;
  if (!good && !must) return std::nullopt;
  std::array<std::int16_t, 4> gain{};
  for (std::size_t k = 0; k < 4; ++k) gain[k] = good ? static_cast<std::int16_t>(fit[k]) : std::int16_t{0};
  if (!good) for_each(mask, [&](std::size_t p) { gain[0] = static_cast<std::int16_t>(part.gain[p]); });
  return gain;
}

/// Adds one record for the pixels of one mask, or a pair for those of two, and returns true; if the patches cannot hold
/// them, returns false. With `must` it always adds the record (a single pixel always fits).
bool TileBuilder::add_records(const Part& part, std::span<const PixelMask> masks, bool must, TileRun& run) {
  const RaySampler::Plane& plane = sampler_.plane(grid_, part.head);
  const int width = plane.width >> part.level;
  const int height = plane.height >> part.level;
  std::array<std::array<std::int16_t, 4>, 2> gains{};
  for (std::size_t k = 0; k < masks.size() && vignetting_scale_ != 0; ++k) {
    const std::optional<std::array<std::int16_t, 4>> gain = fit_gain(part, masks[k], must);
    if (!gain) return false;
    gains[k] = *gain;
  }
  std::optional<std::array<PatchRecord, 2>> records =
      fit_patches(part.x, part.y, masks, width, height, run.coordinates);
  if (!records) return false;
  for (std::size_t k = 0; k < masks.size(); ++k) {
    PatchRecord& record = (*records)[k];
    record.source = PatchRecord::source_of(part.head, part.level, record.listed());
    run.records.push_back(record);
    if (vignetting_scale_ != 0) run.gains.push_back(gains[k]);
  }
  return true;
}

void TileBuilder::share(PixelMask inside, TileRun& run) {
  PixelMask covered = 0;
  for (const Made& made : made_) covered |= made.mask;
  const bool closed = covered == inside;
  if (made_.empty() || (made_.size() == 1 && closed)) return;  // Sharing::kAlone
  const auto sharing = [&](Sharing how) {
    run.tiles.back().sharing =
        static_cast<std::uint32_t>(how) << 30 | static_cast<std::uint32_t>(run.weights.size() / 4);
  };
  const std::size_t begin = run.weights.size();
  sharing(Sharing::kBilinear);
  if (closed && made_.size() == parts_.size() && share_bilinear(inside, run)) return;
  run.weights.resize(begin);
  sharing(closed ? Sharing::kListed : Sharing::kOpen);
  for (std::size_t k = 0; k + (closed ? 1 : 0) < made_.size(); ++k) {
    const std::size_t at = run.weights.size();
    run.weights.resize(at + blend::kTilePixels);
    const Part& part = parts_[made_[k].part];
    for_each(made_[k].mask, [&](std::size_t p) { run.weights[at + p] = static_cast<std::int16_t>(-part.weight[p]); });
  }
}

/// Stores four coefficients per head. Returns false if they are not within kWeightFit at every pixel, or not exactly 0
/// where the weight is 0.
bool TileBuilder::share_bilinear(PixelMask inside, TileRun& run) {
  PixelValues rest{};
  for_each(inside, [&](std::size_t p) { rest[p] = kWhole; });
  bool good = true;
  for (std::size_t k = 0; k < made_.size() && good; ++k) {
    const PixelValues& weight = parts_[made_[k].part].weight;
    const bool last = k + 1 == made_.size();
    std::array<std::int32_t, 4> fit{};
    if (!last) fit = fit_bilinear(weight, inside);
    for_each(inside, [&](std::size_t p) {
      const auto i = static_cast<std::int32_t>(p % 8);
      const auto j = static_cast<std::int32_t>(p / 8);
      const std::int32_t at = last ? rest[p] : fit[0] + fit[1] * i + fit[2] * j + fit[3] * i * j;
      good = good && at >= 0 && at <= kWhole && std::abs(at - weight[p]) <= (weight[p] == 0 ? 0 : kWeightFit);
      rest[p] -= at;
    });
    if (last) break;
    for (const std::int32_t coefficient : fit) {
      good = good && coefficient >= -32767 && coefficient <= 32768;
      run.weights.push_back(static_cast<std::int16_t>(static_cast<std::uint16_t>(-coefficient)));
    }
  }
  return good;
}

}  // namespace nodal::table
