// The lag between two heads from flashes that both see.
#pragma once

#include <vector>

#include "protocol/base/result.h"
#include "stitch/timing/lag.h"

namespace nodal::timing {

/// The brightness of one head's frames.
struct Brightness {
  std::vector<double> times{};  ///< s, by the head's clock: when the first row begins to be exposed; increasing
  int rows = 1;                 ///< values a frame: means of as many bands of rows, from the top; 1: the whole frame's
  double readout = 0;           ///< s from the first to the last row's exposure; 0: not known
  std::vector<double> luma{};   ///< rows values for every frame
};

/// When a flash was.
struct Flash {
  double time = 0;   ///< s
  double sigma = 0;  ///< s
};

/// Flashes that are shorter than a frame. With rows and the readout, the time is that of the lowest row that was lit:
/// rows above it were being exposed, rows below it not yet. Without, it is known to a frame only.
std::vector<Flash> flashes_of(const Brightness& brightness);

/// The lag that makes most flashes of `a` flashes of `b`. From one flash, `used` is 1: a second light somewhere else
/// looks the same, so another source must confirm it.
///
/// Errors: kBadValue if counts differ or times do not increase; kNotDetermined, with a sentence, if there is no flash,
/// if most flashes of both do not match, or if several lags fit equally.
///
/// Threading: thread-safe.
Result<Lag> flash_lag(const Brightness& a, const Brightness& b, const Search& search);

}  // namespace nodal::timing
