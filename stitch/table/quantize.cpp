#include "stitch/table/quantize.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace nodal::table {
namespace {

/// In steps of the rounding; far above the noise of double precision, far below what matters.
constexpr double kTie = 1e-5;

std::int64_t round_up_ties(double value) { return static_cast<std::int64_t>(std::floor(value + 0.5 + kTie)); }

/// A coordinate in fractions of a sample, such that it and its right neighbour are inside.
std::int64_t quantize_coordinate(double at, int size) {
  constexpr std::int64_t kOne = 1 << blend::kFractionBits;
  return std::clamp<std::int64_t>(round_up_ties(at * kOne), 0, (size - 1) * kOne - 1);
}

/// Shares 1 << kWeightBits out. Remainders are compared as integers, and equal ones by head, so that three heads
/// of a third each are the same three numbers everywhere.
void share_out(std::span<const RaySample> samples, std::array<std::uint16_t, kMaxHeads>& weights) {
  constexpr int kRemainderBits = 16;
  std::array<std::int64_t, kMaxHeads> fine{};
  std::int64_t left = 1 << blend::kWeightBits;
  for (std::size_t k = 0; k < samples.size(); ++k) {
    fine[k] = round_up_ties(std::ldexp(samples[k].weight, blend::kWeightBits + kRemainderBits));
    weights[k] = static_cast<std::uint16_t>(fine[k] >> kRemainderBits);
    fine[k] -= std::int64_t{weights[k]} << kRemainderBits;
    left -= weights[k];
  }
  while (left > 0) {
    const auto most = std::max_element(fine.begin(), fine.begin() + static_cast<std::ptrdiff_t>(samples.size()));
    ++weights[static_cast<std::size_t>(most - fine.begin())];
    *most = -1;
    --left;
  }
}

}  // namespace

std::uint16_t quantize_gain(double gain) {
  return static_cast<std::uint16_t>(
      std::clamp<std::int64_t>(round_up_ties(std::min(gain, 16.0) * (1 << blend::kGainBits)), 1, blend::kMaxGain));
}

void append_taps(std::span<const RaySample> samples, const RaySampler& sampler, int grid,
                 std::vector<blend::Tap>& taps) {
  if (samples.empty()) return;
  constexpr std::int64_t kMask = (1 << blend::kFractionBits) - 1;
  std::array<std::uint16_t, kMaxHeads> weights;
  share_out(samples, weights);
  for (std::size_t k = 0; k < samples.size(); ++k) {
    const RaySample& sample = samples[k];
    if (weights[k] == 0) continue;
    const RaySampler::Plane& plane = sampler.plane(grid, sample.head);
    const std::int64_t x = quantize_coordinate(sample.x, plane.width);
    const std::int64_t y = quantize_coordinate(sample.y, plane.height);
    taps.push_back({static_cast<std::uint16_t>(x >> blend::kFractionBits),
                    static_cast<std::uint16_t>(y >> blend::kFractionBits), static_cast<std::uint16_t>(x & kMask),
                    static_cast<std::uint16_t>(y & kMask), weights[k], quantize_gain(sample.gain), sample.head, 0});
  }
}

}  // namespace nodal::table
