// The samples of a raymap: 8 bits, or 16 with the lower byte first.
#pragma once

#include <bit>
#include <cstdint>
#include <cstring>

#include "stitch/view/filter.h"

namespace nodal::view {

static_assert(std::endian::native == std::endian::little, "16 bits are read as they lie in memory");

/// The types used in computations with a sample type.
template <class Sample>
struct Samples;

template <>
struct Samples<std::uint8_t> {
  using Scaled = std::int16_t;  ///< holds filtered levels in 1/64
  using Real = float;
  static constexpr int kMax = 255;
  static const auto& phases(const Taps& taps) { return taps.phases; }
  static constexpr int kOne = Taps::kOne;
};

template <>
struct Samples<std::uint16_t> {
  using Scaled = std::int32_t;
  using Real = double;
  static constexpr int kMax = 65535;
  static const auto& phases(const Taps& taps) { return taps.fine; }
  static constexpr int kOne = Taps::kFineOne;
};

/// `at` may have any alignment.
template <class Sample>
Sample load(const std::uint8_t* at) {
  Sample sample;
  std::memcpy(&sample, at, sizeof sample);
  return sample;
}

template <class Sample>
void store(Sample sample, std::uint8_t* at) {
  std::memcpy(at, &sample, sizeof sample);
}

}  // namespace nodal::view
