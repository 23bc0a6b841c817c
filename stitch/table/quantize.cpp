#include "stitch/table/quantize.h"

#include <algorithm>

namespace nodal::table {

std::uint16_t quantize_gain(double gain) {
  return static_cast<std::uint16_t>(
      std::clamp<std::int64_t>(round_up_ties(std::min(gain, 16.0) * (1 << blend::kGainBits)), 1, blend::kMaxGain));
}

std::int32_t quantize_coordinate(double at, int size) {
  constexpr std::int64_t kOne = 1 << blend::kFractionBits;
  return static_cast<std::int32_t>(std::clamp<std::int64_t>(round_up_ties(at * kOne), 0, (size - 1) * kOne - 1));
}

void share_out(std::span<const RaySample> samples, std::array<std::uint16_t, kMaxHeads>& weights) {
  constexpr int kRemainderBits = 16;
  constexpr auto kFine = static_cast<double>(std::int64_t{1} << (blend::kWeightBits + kRemainderBits));
  std::array<std::int64_t, kMaxHeads> fine{};
  std::int64_t left = 1 << blend::kWeightBits;
  for (std::size_t k = 0; k < samples.size(); ++k) {
    fine[k] = round_up_ties(samples[k].weight * kFine);
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

}  // namespace nodal::table
