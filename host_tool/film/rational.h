// Fractions of seconds: a film's times have the unit that its file says.
#pragma once

#include <cstdint>

namespace nodal::film {

struct Rational {
  std::int64_t num = 0;
  std::int64_t den = 1;
  friend bool operator==(const Rational&, const Rational&) = default;
};

// Products of a time and two terms of a time base exceed 64 bits.
__extension__ using Wide = __int128;

/// a * b < c * d, exactly.
constexpr int compare(std::int64_t a, Rational b, std::int64_t c, Rational d) {
  const Wide left = Wide{a} * b.num * d.den;
  const Wide right = Wide{c} * d.num * b.den;
  return left < right ? -1 : left > right ? 1 : 0;
}

constexpr double seconds_of(std::int64_t count, Rational unit) {
  return static_cast<double>(count) * static_cast<double>(unit.num) / static_cast<double>(unit.den);
}

}  // namespace nodal::film
