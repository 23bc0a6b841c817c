// Random numbers of the simulator. Integers only, and a separate stream per user, so that a seed gives the same events
// on every machine and the draws of one port do not affect another.
#pragma once

#include <cstdint>
#include <string_view>

#include "protocol/base/units.h"

namespace nodal::hal::sim {

/// splitmix64 (Steele, Lea, Flood 2014), seeded with a seed and the name of its user.
class Random {
 public:
  Random(std::uint64_t seed, std::string_view stream) : state_(seed * 0x9E3779B97F4A7C15ULL) {
    for (const char c : stream) state_ = (state_ ^ static_cast<unsigned char>(c)) * 0x100000001B3ULL;
    next();
  }

  std::uint64_t next() {
    std::uint64_t z = (state_ += 0x9E3779B97F4A7C15ULL);
    z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9ULL;
    z = (z ^ (z >> 27)) * 0x94D049BB133111EBULL;
    return z ^ (z >> 31);
  }
  /// 0 .. n-1; n > 0.
  std::uint64_t below(std::uint64_t n) { return next() % n; }
  /// 0 .. length, without length; length > 0.
  Duration below(Duration length) {
    return Duration::nanoseconds(static_cast<std::int64_t>(below(static_cast<std::uint64_t>(length.ns()))));
  }
  /// True with a probability of `per_million` in a million.
  bool chance(std::uint32_t per_million) { return per_million != 0 && below(1'000'000) < per_million; }
  /// Between -reach and +reach.
  Duration around_zero(Duration reach) {
    if (reach.ns() <= 0) return {};
    const auto width = 2 * static_cast<std::uint64_t>(reach.ns()) + 1;
    return Duration::nanoseconds(static_cast<std::int64_t>(below(width)) - reach.ns());
  }

 private:
  std::uint64_t state_;
};

}  // namespace nodal::hal::sim
