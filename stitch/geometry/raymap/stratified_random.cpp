#include "stitch/geometry/raymap/stratified_random.h"

#include <algorithm>
#include <cmath>

#include "protocol/base/angles.h"

namespace nodal::geometry {
namespace {

constexpr double kTurn = 4294967296.0;

/// SplitMix64 (Steele, Lea and Flood 2014) at position k of the sequence: the upper half.
std::uint32_t random_at(std::uint64_t seed, std::uint64_t k) {
  std::uint64_t z = seed + (k + 1) * 0x9E3779B97F4A7C15U;
  z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9U;
  z = (z ^ (z >> 27)) * 0x94D049BB133111EBU;
  return static_cast<std::uint32_t>((z ^ (z >> 31)) >> 32);
}

}  // namespace

StratifiedRandom::StratifiedRandom(RaymapSize size, std::uint64_t seed)
    : ScatteredRays(size.width, size.height), seed_(seed) {
  const std::size_t count = static_cast<std::size_t>(size.width) * static_cast<std::size_t>(size.height);
  turns_.reserve(count);
  for (std::size_t k = 0; k < count; ++k) turns_.push_back(random_at(seed, 2 * k));
  for (auto row = turns_.begin(); row != turns_.end(); row += size.width) std::sort(row, row + size.width);
}

Result<std::unique_ptr<RaymapLayout>> StratifiedRandom::make(RaymapSize size, std::int64_t seed) {
  return std::unique_ptr<RaymapLayout>(new StratifiedRandom(size, static_cast<std::uint64_t>(seed)));
}

Ray StratifiedRandom::ray_of(int i, int j) const {
  const std::uint32_t& theta = turn(i, j);
  const auto k = static_cast<std::uint64_t>(&theta - turns_.data());
  const double within = (random_at(seed_, 2 * k + 1) + 0.5) / kTurn;
  const double u = (j + within) / height();
  return Ray::at(SinCos::of(2 * kPi * ((theta + 0.5) / kTurn - 0.5)), {2 * u - 1, 2 * std::sqrt(u * (1 - u))});
}

double StratifiedRandom::solid_angle(int i, int j) const {
  if (width() == 1) return 4 * kPi / height();
  // Modulo a turn; the differences of a whole row sum to two turns, also where two rays have one theta.
  const auto gap = [&](int a) {
    const std::uint32_t from = turn(a, j), to = turn((a + 1) % width(), j);
    return a + 1 < width() ? static_cast<double>(to - from) : kTurn - static_cast<double>(from - to);
  };
  return (gap((i + width() - 1) % width()) + gap(i)) / 2 / kTurn * 4 * kPi / height();
}

}  // namespace nodal::geometry
