// Brings heads that run free into step, and holds them there.
#pragma once

#include <array>
#include <cstdint>
#include <optional>

#include "firmware/frame/frame_set.h"
#include "firmware/sync/genlock.h"
#include "firmware/sync/phase_line.h"
#include "hal/head.h"

namespace nodal::firmware {

/// A head as the aligner sees it, now.
struct FreeHead {
  bool streaming = false;
  std::uint64_t starts = 0;  ///< times it was started
  hal::NudgeLimits limits;
  Exposure exposure;  ///< of the frames that a nudge of now will move first
};

/// Each head's clock is a PhaseLine of the times at which its exposures would begin without nudges: FrameView::nudged, what
/// the head has moved by so far, is subtracted from every timestamp. So a nudge does not disturb the estimate of the clock,
/// and where the head will be after all requested nudges is known, however long they take.
///
/// All heads are moved until the middles of their exposures are at one reference. Where there are heads that cannot be
/// moved, the reference is their median. Else it is the median of all heads, or, of heads near that median which can only
/// wait, the latest; a head far after it waits for the next period. A head within the dead band around the reference gets
/// no request. The band is narrow until the heads are in step; then it is an eighth of what jitter leaves of the lock's
/// limit.
///
/// Threading: thread-bound to capture.
/// Ownership: none. Allocates nothing.
/// Errors: none.
class Aligner {
 public:
  void restart(Duration period);
  /// A frame that went into a set, of a head that was started so many times.
  void on_frame(std::size_t head, std::uint64_t starts, const hal::FrameView& frame);
  using Nudges = std::array<Duration, kMaxHeads>;
  /// The nudge to request of each head now; it counts as requested.
  Nudges plan(const std::array<FreeHead, kMaxHeads>& heads, bool in_step, Instant now);
  /// Of a set's frames: middles after a beat at the heads' rate, and what nudges and exposures moved them by since the
  /// head's last.
  Skews skews(const FrameSet& set);

  HeadMask fixed() const { return fixed_; }                ///< heads that cannot be moved
  HeadMask one_way() const { return one_way_; }            ///< that would have to be earlier, and can only wait
  HeadMask unresponsive() const { return unresponsive_; }  ///< that did not do what was requested
  std::optional<std::int32_t> drift_ppb(std::size_t head) const { return heads_[head].clock.drift_ppb(); }

  /// Two heads at opposite ends of the band are a quarter of the limit apart; the rest is for doubt and jitter.
  static constexpr std::int64_t kBandsInLimit = 8;
  static constexpr Duration kBandMost = Genlock::kSafeLimit / kBandsInLimit;
  /// What a crystal that is off by 50 ppm creeps in the longest period, 200 ms: a narrower band would ask for a nudge
  /// every period.
  static constexpr Duration kBandLeast = Duration::microseconds(10);

 private:
  struct Head {
    PhaseLine clock;
    std::uint64_t starts = 0;
    Duration requested, done;  ///< since the head was started
    hal::NudgeLimits limits;
    Instant still_since;  ///< while a request is open: when it last moved
    Instant left_alone_until;
    bool responds = true;
    Duration place_in_set;  ///< where nudges and half the exposure put the middle of its last frame in a set
  };
  std::optional<Duration> reference_place(const std::array<FreeHead, kMaxHeads>& heads, Instant base, Instant at,
                                          Instant now, Nudges& places, HeadMask& placed) const;
  void follow(Head& head, const hal::FrameView& frame) const;
  Duration band(bool in_step) const;
  Duration near() const { return period_ / 8; }
  Duration true_period() const;

  Duration period_;
  std::array<Head, kMaxHeads> heads_{};
  std::optional<Instant> reference_;  ///< a middle of it
  std::optional<Instant> beat_;       ///< near the newest set, and
  Instant newest_set_;                ///< its middle
  HeadMask fixed_ = 0, one_way_ = 0, unresponsive_ = 0;
};

}  // namespace nodal::firmware
