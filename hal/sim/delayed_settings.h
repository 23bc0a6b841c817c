// The settings of a simulated head, which take effect some frames after they were made.
#pragma once

#include <algorithm>
#include <deque>

#include "hal/head.h"

namespace nodal::hal::sim {

/// Threading: thread-bound.
/// Ownership: none.
/// Errors: none.
class DelayedSettings {
 public:
  /// `latency`: in frames.
  DelayedSettings(const HeadSettings& settings, int latency)
      : wanted_(settings), in_effect_(settings), latency_(latency) {}

  const HeadSettings& wanted() const { return wanted_; }
  /// Settings of the next exposure.
  const HeadSettings& in_effect() const { return in_effect_; }
  /// While stuck, settings are accepted and not applied.
  void set_stuck(bool stuck) { stuck_ = stuck; }
  bool stuck() const { return stuck_; }

  void make(const HeadSettings& wanted, bool streaming) {
    wanted_ = wanted;
    if (stuck_) return;
    if (!streaming) {
      in_effect_ = wanted;
      return;
    }
    // The newest of several changes between two exposures replaces the others, so an untriggered head keeps only one.
    if (!changes_.empty() && changes_.back().frames_left == latency_) changes_.pop_back();
    changes_.push_back({wanted, latency_});
  }
  /// An exposure begins.
  void next_exposure() {
    while (!changes_.empty() && changes_.front().frames_left == 0) {
      in_effect_ = changes_.front().settings;
      changes_.pop_front();
    }
    for (Change& change : changes_) --change.frames_left;
  }
  /// The stream ends: written registers keep their values, and no delayed setting waits for a frame.
  void end_stream() {
    if (!stuck_) in_effect_ = wanted_;
    changes_.clear();
  }
  /// The head was without power.
  void reset(const HeadSettings& settings) {
    wanted_ = in_effect_ = settings;
    changes_.clear();
  }
  /// The shortest exposure that the next frame can have.
  Duration shortest_exposure() const {
    Duration shortest = in_effect_.exposure.duration();
    for (const Change& change : changes_) shortest = std::min(shortest, change.settings.exposure.duration());
    return shortest;
  }

 private:
  struct Change {
    HeadSettings settings;
    int frames_left = 0;
  };

  HeadSettings wanted_;
  HeadSettings in_effect_;
  const int latency_;
  std::deque<Change> changes_;
  bool stuck_ = false;
};

}  // namespace nodal::hal::sim
