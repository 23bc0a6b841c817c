// The lag between two heads from their sound.
#pragma once

#include "protocol/base/result.h"
#include "stitch/timing/lag.h"
#include "stitch/timing/sound_track.h"

namespace nodal::timing {

/// Correlates chunks of `a` with `b` (GCC-PHAT, as the tracks are whitened): 16 over the whole search to find the line,
/// then up to 60 over the whole overlap, with `b` resampled along the line, to measure it. The lag is that of the
/// recorded sound: microphones that are 30 cm apart hear a source up to 0.9 ms apart, which the variances do not hold.
///
/// Errors: kNotDetermined, with a sentence for people, if a sound is silent, if both have nothing in common, if the
/// sound repeats (a second lag correlates almost as well), if the overlap is too short, or if the lags are not on one
/// line.
///
/// Threading: thread-safe.
Result<Lag> sound_lag(const SoundTrack& a, const SoundTrack& b, const Search& search);

}  // namespace nodal::timing
