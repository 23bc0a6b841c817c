// Moves heads that run free until they expose together, and keeps them together.
#pragma once

#include <array>
#include <cstdint>
#include <optional>

#include "firmware/frame/frame_set.h"
#include "firmware/sync/genlock.h"
#include "firmware/sync/phase_line.h"
#include "hal/head.h"

namespace nodal::firmware {

/// The current state of a head, for the aligner.
struct FreeHead {
  bool streaming = false;
  std::uint64_t starts = 0;  ///< times it was started
  hal::NudgeLimits limits;
  Exposure exposure;  ///< exposure of the first frames that a nudge requested now would move
};

/// For each head, a PhaseLine estimates when its exposures would begin without nudges: FrameView::nudged, the sum of
/// all nudges so far, is subtracted from every timestamp. So nudges do not disturb the estimate of the clock, and the
/// phase after all requested nudges is known, however long they take.
///
/// All heads are moved until the middles of their exposures are at one reference. If there are heads that cannot be
/// moved, the reference is their median. Otherwise it is the median of all heads; or, if heads near that median can
/// only be delayed, the latest of those. A head long after the reference is delayed until the next period. A head
/// within the dead band around the reference gets no request. The band is narrow until the heads are in step; then it
/// is an eighth of the part of the lock's limit that jitter does not use.
///
/// Threading: thread-bound to capture.
/// Ownership: none. Allocates nothing.
/// Errors: none.
class Aligner {
 public:
  void restart(Duration period);
  /// Reports a frame that is in a set, and how often its head was started.
  void on_frame(std::size_t head, std::uint64_t starts, const hal::FrameView& frame);
  using Nudges = std::array<Duration, kMaxHeads>;
  /// The nudges to request now, by head; they count as requested.
  Nudges plan(const std::array<FreeHead, kMaxHeads>& heads, bool in_step, Instant now);
  /// The skews of a set's frames: each middle relative to a beat at the heads' rate, and how far nudges and exposures
  /// have moved it since the head's last frame.
  Skews skews(const FrameSet& set);

  HeadMask fixed() const { return fixed_; }      ///< heads that cannot be moved
  HeadMask one_way() const { return one_way_; }  ///< heads that would have to be earlier and can only be delayed
  HeadMask unresponsive() const { return unresponsive_; }  ///< heads that did not carry out a request
  std::optional<std::int32_t> drift_ppb(std::size_t head) const { return heads_[head].clock.drift_ppb(); }

  /// Two heads at opposite ends of the band are a quarter of the limit apart; the rest is for uncertainty and jitter.
  static constexpr std::int64_t kBandsInLimit = 8;
  static constexpr Duration kBandMax = Genlock::kSafeLimit / kBandsInLimit;
  /// How far a crystal with an error of 50 ppm moves in the longest period, 200 ms: a narrower band would cause a
  /// request in every period.
  static constexpr Duration kBandMin = Duration::microseconds(10);

 private:
  struct Head {
    PhaseLine clock;
    std::uint64_t starts = 0;
    Duration requested, done;  ///< since the head was started
    hal::NudgeLimits limits;
    Instant still_since;  ///< while a request is open: when it last moved
    Instant left_alone_until;
    bool responds = true;
    Duration place_in_set;  ///< shift of the middle of its last frame in a set by nudges and half the exposure
  };
  std::optional<Duration> reference_place(const std::array<FreeHead, kMaxHeads>& heads, Instant base, Instant at,
                                          Instant now, Nudges& places, HeadMask& placed) const;
  void follow(Head& head, const hal::FrameView& frame) const;
  Duration band(bool in_step) const;
  Duration near() const { return period_ / 8; }
  Duration true_period() const;

  Duration period_;
  std::array<Head, kMaxHeads> heads_{};
  std::optional<Instant> reference_;  ///< the middle of one exposure of the reference
  std::optional<Instant> beat_;       ///< near the newest set, and
  Instant newest_set_;                ///< its middle
  HeadMask fixed_ = 0, one_way_ = 0, unresponsive_ = 0;
};

}  // namespace nodal::firmware
