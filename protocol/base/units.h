// Numbers with a unit as types. Different units do not mix; the raw value is available only through a function that
// names the unit. Integers only, so that rig, host and simulator agree to the bit.
#pragma once

#include <compare>
#include <cstdint>
#include <numeric>
#include <optional>

namespace nodal {

/// A duration in nanoseconds; may be negative.
class Duration {
 public:
  constexpr Duration() = default;
  static constexpr Duration nanoseconds(std::int64_t n) { return Duration(n); }
  static constexpr Duration microseconds(std::int64_t n) { return Duration(n * 1'000); }
  static constexpr Duration milliseconds(std::int64_t n) { return Duration(n * 1'000'000); }
  static constexpr Duration seconds(std::int64_t n) { return Duration(n * 1'000'000'000); }

  constexpr std::int64_t ns() const { return ns_; }
  constexpr std::int64_t us() const { return ns_ / 1'000; }
  constexpr std::int64_t ms() const { return ns_ / 1'000'000; }

  friend constexpr auto operator<=>(Duration, Duration) = default;
  friend constexpr Duration operator+(Duration a, Duration b) { return Duration(a.ns_ + b.ns_); }
  friend constexpr Duration operator-(Duration a, Duration b) { return Duration(a.ns_ - b.ns_); }
  friend constexpr Duration operator-(Duration a) { return Duration(-a.ns_); }
  friend constexpr Duration abs(Duration a) { return a.ns_ < 0 ? -a : a; }
  friend constexpr Duration operator*(Duration a, std::int64_t n) { return Duration(a.ns_ * n); }
  friend constexpr Duration operator/(Duration a, std::int64_t n) { return Duration(a.ns_ / n); }

 private:
  explicit constexpr Duration(std::int64_t ns) : ns_(ns) {}
  std::int64_t ns_ = 0;
};

/// A time on the rig's monotonic clock, in nanoseconds since that clock's start.
class Instant {
 public:
  constexpr Instant() = default;
  static constexpr Instant from_ns(std::int64_t ns) { return Instant(ns); }
  constexpr std::int64_t ns() const { return ns_; }

  friend constexpr auto operator<=>(Instant, Instant) = default;
  friend constexpr Duration operator-(Instant a, Instant b) { return Duration::nanoseconds(a.ns_ - b.ns_); }
  friend constexpr Instant operator+(Instant a, Duration d) { return Instant(a.ns_ + d.ns()); }
  friend constexpr Instant operator-(Instant a, Duration d) { return Instant(a.ns_ - d.ns()); }

 private:
  explicit constexpr Instant(std::int64_t ns) : ns_(ns) {}
  std::int64_t ns_ = 0;
};

/// Frames per second as a fraction, because NTSC's 30000/1001 has no exact decimal. A rate from a host, a file or a
/// command line must go through make(), which ensures that the arithmetic below fits 64 bits.
struct FrameRate {
  std::uint32_t numerator = 30000;
  std::uint32_t denominator = 1001;

  static constexpr std::uint32_t kMaxTerm = 1'000'000;  ///< largest term of the reduced fraction
  static constexpr std::uint32_t kFastest = 1000;  ///< frames per second; the slowest: one frame in kFastest seconds
  /// The largest result of start_of(): 146 years. Added to the clock's present time it still fits 64 bits.
  static constexpr std::int64_t kFarthestNs = INT64_MAX / 2;

  /// The reduced fraction, or nothing if a term is 0 or, reduced, above kMaxTerm, or if the rate is not between
  /// 1/kFastest and kFastest.
  static constexpr std::optional<FrameRate> make(std::uint64_t numerator, std::uint64_t denominator) {
    if (numerator == 0 || denominator == 0) return std::nullopt;
    const std::uint64_t common = std::gcd(numerator, denominator);
    const std::uint64_t n = numerator / common;
    const std::uint64_t d = denominator / common;
    if (n > kMaxTerm || d > kMaxTerm || n > kFastest * d || d > kFastest * n) return std::nullopt;
    return FrameRate{static_cast<std::uint32_t>(n), static_cast<std::uint32_t>(d)};
  }
  constexpr bool valid() const { return make(numerator, denominator).has_value(); }

  constexpr Duration period() const {
    return Duration::nanoseconds(static_cast<std::int64_t>(1'000'000'000) * denominator / numerator);
  }
  /// The start of frame n, relative to frame 0, without accumulated rounding: n·d/numerator seconds, rounded down to a
  /// nanosecond, at most kFarthestNs.
  constexpr Duration start_of(std::uint64_t n) const {
    // 64 + 32 + 30 bits: the product fits 128 bits.
    const unsigned __int128 ns = static_cast<unsigned __int128>(n) * denominator * 1'000'000'000U / numerator;
    return Duration::nanoseconds(ns < static_cast<unsigned __int128>(kFarthestNs) ? static_cast<std::int64_t>(ns)
                                                                                  : kFarthestNs);
  }
  /// The first frame that starts after `at`, in the same time base as start_of(); 0 if `at` is before frame 0.
  constexpr std::uint64_t first_after(Duration at) const {
    if (at.ns() < 0) return 0;
    // Frame k starts after `at` if floor(k·d·1e9 / n) >= at + 1, that is if k >= (at + 1)·n / (d·1e9), rounded up.
    const unsigned __int128 scaled = (static_cast<unsigned __int128>(at.ns()) + 1) * numerator;
    const unsigned __int128 second = static_cast<unsigned __int128>(denominator) * 1'000'000'000U;
    return static_cast<std::uint64_t>((scaled + second - 1) / second);
  }
  friend constexpr bool operator==(FrameRate, FrameRate) = default;
};

/// The time during which a sensor collects light.
class Exposure {
 public:
  constexpr Exposure() = default;
  static constexpr Exposure microseconds(std::int64_t us) { return Exposure(Duration::microseconds(us)); }
  static constexpr Exposure of(Duration d) { return Exposure(d); }
  constexpr Duration duration() const { return d_; }
  constexpr std::int64_t us() const { return d_.us(); }
  friend constexpr auto operator<=>(Exposure, Exposure) = default;

 private:
  explicit constexpr Exposure(Duration d) : d_(d) {}
  Duration d_ = Duration::microseconds(10'000);
};

/// Analogue gain of a head in thousandths of a decibel; 6020 is one stop.
class Gain {
 public:
  constexpr Gain() = default;
  static constexpr Gain millidecibels(std::int32_t n) { return Gain(n); }
  constexpr std::int32_t mdb() const { return mdb_; }
  friend constexpr auto operator<=>(Gain, Gain) = default;

 private:
  explicit constexpr Gain(std::int32_t mdb) : mdb_(mdb) {}
  std::int32_t mdb_ = 0;
};

/// Red and blue gains relative to green, in 1/4096: {4096, 4096} changes nothing.
struct WhiteBalance {
  std::uint16_t red_q12 = 4096;
  std::uint16_t blue_q12 = 4096;
  friend constexpr bool operator==(WhiteBalance, WhiteBalance) = default;
};

/// A head's index in the rig, 0 .. kMaxHeads-1, in the order of rig.toml and of the calibration.
using HeadIndex = std::uint8_t;
inline constexpr int kMinHeads = 1;
inline constexpr int kMaxHeads = 16;

}  // namespace nodal
