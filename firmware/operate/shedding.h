// Sheds work in a fixed order when the board is overloaded.
#pragma once

#include <array>
#include <cstdint>
#include <optional>

#include "protocol/base/frame_time.h"
#include "protocol/base/units.h"

namespace nodal::firmware {

/// How much work is done: one of publish_every raymaps is encoded and published, one of preview_every sets is blended.
/// Capture is never shed: all frames are taken, grouped into sets and counted.
struct ShedLevel {
  std::uint32_t publish_every = 1;
  std::uint32_t preview_every = 1;
  friend bool operator==(const ShedLevel&, const ShedLevel&) = default;
};

/// Publishing is shed first, then the blend of the preview.
inline constexpr std::array<ShedLevel, 6> kShedLevels{{{1, 1}, {2, 1}, {4, 1}, {8, 1}, {8, 2}, {8, 4}}};

/// Raises the level by one when the blend missed more than 1/20 of the sets in each of two consecutive windows. Lowers
/// it by one after kPatience consecutive windows without a miss; if the board is then overloaded again, that number
/// doubles.
///
/// Threading: thread-bound to control.
/// Ownership: none. Allocates nothing.
/// Errors: none.
class Shedding {
 public:
  static constexpr FrameTime kWindow{Duration::seconds(1), 4};
  static constexpr int kPatience = 5;
  static constexpr int kMaxPatience = 80;

  /// `sets` and `not_taken` are totals since the start. `excused`: this window does not reflect the board's speed.
  /// `period`: of the frame rate in force.
  void step(std::uint64_t sets, std::uint64_t not_taken, bool excused, Duration period, Instant now);
  const ShedLevel& level() const { return kShedLevels[level_]; }

 private:
  std::size_t level_ = 0;
  int overloaded_ = 0;  ///< consecutive overloaded windows
  int calm_ = 0;        ///< consecutive windows without a miss
  int patience_ = kPatience;
  bool lowered_ = false;  ///< the last change of the level was a decrease
  bool excused_ = false;  ///< `excused` was true at some time in this window
  std::optional<Instant> window_;
  std::uint64_t sets_ = 0;
  std::uint64_t not_taken_ = 0;
};

}  // namespace nodal::firmware
