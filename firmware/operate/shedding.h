// What is left undone, and in which order, when the board cannot do everything.
#pragma once

#include <array>
#include <cstdint>
#include <optional>

#include "protocol/base/units.h"

namespace nodal::firmware {

/// How much is done: every so many raymaps are encoded and published, every so many sets are blended. Capture is not in
/// it: frames are taken, put into sets and counted whatever happens.
struct ShedLevel {
  std::uint32_t publish_every = 1;
  std::uint32_t preview_every = 1;
  friend bool operator==(const ShedLevel&, const ShedLevel&) = default;
};

/// Publishing goes first, then the preview.
inline constexpr std::array<ShedLevel, 6> kShedLevels{{{1, 1}, {2, 1}, {4, 1}, {8, 1}, {8, 2}, {8, 4}}};

/// Goes one level up when the blend had no room for a twentieth of the sets in two windows on end, one down when it had
/// for all of them long enough: kPatience windows, twice as many after each time that turned out to be too soon.
///
/// Threading: thread-bound to control.
/// Ownership: none. Allocates nothing.
/// Errors: none.
class Shedding {
 public:
  static constexpr Duration kWindow = Duration::seconds(1);
  static constexpr int kPatience = 5;
  static constexpr int kMostPatience = 80;

  /// `sets` and `not_taken` count from the start; `excused`: the rate says nothing of the board just now.
  void step(std::uint64_t sets, std::uint64_t not_taken, bool excused, Instant now);
  const ShedLevel& level() const { return kShedLevels[level_]; }

 private:
  std::size_t level_ = 0;
  int overloaded_ = 0;  ///< windows on end
  int calm_ = 0;        ///< likewise
  int patience_ = kPatience;
  bool lowered_ = false;  ///< the last change was one down
  bool excused_ = false;  ///< at any time of the window
  std::optional<Instant> window_;
  std::uint64_t sets_ = 0;
  std::uint64_t not_taken_ = 0;
};

}  // namespace nodal::firmware
