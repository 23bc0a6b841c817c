// The factor on encoded values that undoes a change of light.
#pragma once

#include <vector>

#include "protocol/calibration.h"

namespace nodal::table {

/// The blend multiplies encoded values, but gain and vignetting act on light. If encoded = light^(1/gamma) (a linear
/// response has gamma 1), light * f has the encoded value encoded * f^(1/gamma), and the factor f^(-1/gamma) undoes it
/// exactly, at every level. For sRGB and polynomial responses no factor is exact; the one with the least squared error
/// over all encoded values that the change does not clip is used.
///
/// Threading: immutable.
class EncodedGain {
 public:
  /// The gain of a linear response.
  EncodedGain() = default;
  explicit EncodedGain(const Response& response);

  /// The factor on encoded values that undoes light * `factor`. `factor` is clamped to 1/8 .. 8.
  double undo(double factor) const;

 private:
  double exponent_ = -1;
  std::vector<double> fitted_;  ///< by log2(factor), evenly from -3 to 3; empty if the power is exact
};

}  // namespace nodal::table
