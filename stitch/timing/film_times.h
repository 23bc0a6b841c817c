// The clocks of all heads of a film, from the lags between pairs of them.
#pragma once

#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "protocol/base/result.h"
#include "stitch/timing/lag.h"

namespace nodal::timing {

enum class Source { kSound, kRotation, kFlash };
inline constexpr int kSources = 3;
/// "sound", "rotation", "flash".
std::string_view name_of(Source source);

/// What is known of a head before its lags are.
struct HeadFilm {
  std::string name{};
  double start = 0, end = 0;  ///< s, by its own clock: the times are wanted for these
  /// The reference's time minus its own, s, by what the file says (timecode, date). Wrong by seconds in the wild, so it
  /// only tells takes apart.
  std::optional<double> container{};
};

/// What one source says of two heads: a lag, or why there is none.
struct PairLag {
  int a = 0, b = 0;  ///< places in the list of heads
  Source source = Source::kSound;
  Lag lag{};
};
struct NoLag {
  int a = 0, b = 0;
  Source source = Source::kSound;
  std::string why{};
};

struct FilmOptions {
  int reference = 0;
  double largest_sigma = 4e-3;  ///< s; a head whose time is less certain is refused: a quarter of a frame at 60 Hz
};

/// Time of the reference = offset + (1 + ppm / 1e6) * time of the head.
struct HeadTime {
  double offset = 0;  ///< s
  double ppm = 0;
  double sigma = 0;  ///< standard deviation of the reference's time, the largest over the head's film, s
  double ppm_sigma = 0;
  std::string sources{};  ///< "sound", "sound and rotation"; empty for the reference
};

struct FilmTimes {
  std::vector<HeadTime> heads{};
  double residual = 0;               ///< s, root mean square of what loops of pairs leave; 0 without loops
  std::vector<std::string> notes{};  ///< sentences: lags that were left out, and why
};

/// The weighted least-squares solution of all lags. Beside its variance, every source has an error at every head (the
/// way of sound to the microphone, a shutter's readout): it shows between sources, not within one.
///
/// A lag that contradicts all others is left out, if the rest agrees without it, and would not agree without another
/// one instead. A lag from a single flash counts only if another source confirms it.
///
/// Errors: kNotDetermined, with a sentence that says what to do, if a head has no lag, if lags contradict each other
/// and nothing tells which are wrong, if a head is off its container's time by more than 12 s, or if a head's time is
/// not certain enough. kBadValue: a pair that is not of two heads of the list.
///
/// Threading: thread-safe.
Result<FilmTimes> film_times(std::span<const HeadFilm> heads, std::span<const PairLag> lags,
                             std::span<const NoLag> missing, const FilmOptions& options);

}  // namespace nodal::timing
