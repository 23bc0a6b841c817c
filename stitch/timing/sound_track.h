// The sound of one head, reduced to what lags are measured with: 300 to 4000 Hz, all frequencies and moments equally
// loud.
#pragma once

#include <cstdint>
#include <deque>
#include <span>
#include <string>
#include <vector>

#include "protocol/base/result.h"

namespace nodal::timing {

/// Samples a second of a reduced track. A whole number, so that 44.1 and 48 kHz end on the same grid.
inline constexpr int kBandRate = 10000;

/// A reduced track: an hour takes 144 MB.
struct SoundTrack {
  double start = 0;              ///< time of the first sample, s, by the head's clock
  std::vector<float> samples{};  ///< at kBandRate; 0 where the sound is silent

  double end() const { return start + static_cast<double>(samples.size()) / kBandRate; }
};

/// Reduces one channel of sound, given in blocks of any size.
///
/// Threading: thread-bound.
class SoundReducer {
 public:
  /// `rate`: samples a second, 11025 .. 384000.
  static Result<SoundReducer> make(int rate);

  /// The next samples, -1 .. 1; those that are not finite count as 0.
  void add(std::span<const double> samples);
  /// The track of everything that was added. `start`: time of the first sample, s.
  SoundTrack finish(double start) &&;

 private:
  explicit SoundReducer(int rate);
  void resample();

  int rate_;
  int half_;                     // taps on each side of a new sample
  std::int64_t phases_;          // places of a new sample between two old ones
  std::vector<double> weights_;  // 2 * half_ for each phase
  std::vector<double> old_;      // samples from old_start_ on
  std::int64_t old_start_;       // may be before the first: zeros
  std::vector<float> band_;
};

/// Makes all frequencies from 300 to 4000 Hz equally loud, and all moments, by dividing the spectra of overlapping
/// frames, 0.4 s each, by their magnitude: the phase transform (PHAT) of both sides of a correlation. Frames below
/// -80 dB are 0.
void whiten(std::vector<float>& band);

}  // namespace nodal::timing
