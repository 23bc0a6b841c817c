// What happens to a simulated head's frames on their way.
#pragma once

#include <utility>

#include "hal/head.h"
#include "hal/sim/head_options.h"
#include "hal/sim/scene/random.h"

namespace nodal::hal::sim {

/// A test orders faults for the next frames; others come at random.
///
/// Threading: thread-bound.
/// Ownership: none.
/// Errors: none.
class FrameFaults {
 public:
  // What the test uses.
  /// The next n exposed frames never arrive.
  void lose_frames(int n = 1) { lose_ += n; }
  void corrupt_next_frame() { corrupt_next_ = true; }
  /// The next frame's bytes are wrong, and its verdict does not say so.
  void spoil_next_frame() { spoil_next_ = true; }
  void tear_next_frame() { tear_next_ = true; }
  void duplicate_next_frame() { duplicate_next_ = true; }
  void delay_next_frame(Duration by) { delay_next_ = by; }
  /// The next frame's fields arrive in the other order, or without the second field.
  void swap_next_fields() { swap_fields_next_ = true; }
  void lose_next_field() { lose_field_next_ = true; }
  /// Without a signal, frames continue, grey, with kNoSignal.
  void set_signal(bool present) { signal_ = present; }

 protected:
  struct Fate {
    bool lost = false;
    Duration late;
    FrameVerdict verdict = FrameVerdict::kGood;
    bool spoiled = false;
    bool twice = false;
  };
  /// The fate of the next frame.
  Fate next_fate(const HeadFaults& rates, Random& random) {
    Fate fate;
    fate.lost = lose_ > 0 || random.chance(rates.lose);
    if (fate.lost) {
      if (lose_ > 0) --lose_;
      return fate;
    }
    fate.late = std::exchange(delay_next_, Duration());
    if (random.chance(rates.delay) && rates.longest_delay.ns() > 0)
      fate.late = fate.late + random.below(rates.longest_delay);
    if (!signal_) {
      fate.verdict = FrameVerdict::kNoSignal;
    } else if (tear_next_ || random.chance(rates.tear)) {
      fate.verdict = FrameVerdict::kTorn;
      tear_next_ = false;
    } else if (corrupt_next_ || random.chance(rates.corrupt)) {
      fate.verdict = FrameVerdict::kCorrupt;
      corrupt_next_ = false;
    }
    fate.spoiled = std::exchange(spoil_next_, false);
    fate.twice = duplicate_next_ || random.chance(rates.duplicate);
    if (fate.twice) duplicate_next_ = false;
    return fate;
  }
  /// The fields of the next frame of an interlaced head.
  Fields next_fields(Fields fields) {
    const auto is_top = [&fields] { return fields == Fields::kTopFirst; };
    if (std::exchange(swap_fields_next_, false)) fields = is_top() ? Fields::kBottomFirst : Fields::kTopFirst;
    if (std::exchange(lose_field_next_, false)) fields = is_top() ? Fields::kTopOnly : Fields::kBottomOnly;
    return fields;
  }

 private:
  int lose_ = 0;
  bool corrupt_next_ = false, spoil_next_ = false, tear_next_ = false, duplicate_next_ = false, signal_ = true;
  bool swap_fields_next_ = false, lose_field_next_ = false;
  Duration delay_next_;
};

}  // namespace nodal::hal::sim
