// The sound of one head, reduced to what lags are measured with: 300 to 4000 Hz, all frequencies and moments equally
// loud.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "protocol/base/result.h"
#include "stitch/timing/sound_store.h"
#include "stitch/timing/whitener.h"

namespace nodal::timing {

/// Samples a second of a reduced track. A whole number, so that 44.1 and 48 kHz end on the same grid.
inline constexpr int kBandRate = 10000;

/// A reduced track. Its samples are 0 where the sound is silent.
///
/// Threading: immutable.
class SoundTrack {
 public:
  SoundTrack() = default;
  SoundTrack(double start, std::int64_t count, std::shared_ptr<const SoundStore> store)
      : start_(start), count_(count), store_(std::move(store)) {}

  double start() const { return start_; }  ///< time of the first sample, s, by the head's clock
  double end() const { return start_ + static_cast<double>(count_) / kBandRate; }
  std::int64_t count() const { return count_; }  ///< samples, at kBandRate
  /// Samples from `first` on, as many of `count` as there are.
  Result<std::vector<float>> samples(std::int64_t first, std::int64_t count) const;

 private:
  double start_ = 0;
  std::int64_t count_ = 0;
  std::shared_ptr<const SoundStore> store_;
};

/// Reduces one channel of sound, given in blocks of any size. Memory does not depend on the sound's length.
///
/// Threading: thread-bound.
/// Errors: those of the store.
class SoundReducer {
 public:
  /// `rate`: samples a second, 11025 .. 384000. `store`: where the track is kept.
  static Result<SoundReducer> make(int rate, std::shared_ptr<SoundStore> store = std::make_shared<MemoryStore>());

  /// The next samples, -1 .. 1; those that are not finite count as 0.
  Status add(std::span<const double> samples);
  /// The track of everything that was added. `start`: time of the first sample, s.
  Result<SoundTrack> finish(double start) &&;

 private:
  SoundReducer(int rate, std::shared_ptr<SoundStore> store);
  std::vector<float> resampled();

  int rate_;
  int half_;                     // taps on each side of a new sample
  std::int64_t phases_;          // places of a new sample between two old ones
  std::vector<double> weights_;  // 2 * half_ for each phase
  std::vector<double> old_;      // samples from old_start_ on
  std::int64_t old_start_;       // may be before the first: zeros
  std::int64_t made_ = 0;        // new samples
  Whitener whitener_;
  std::shared_ptr<SoundStore> store_;
};

}  // namespace nodal::timing
