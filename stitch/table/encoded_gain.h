// The factor on encoded values that undoes a change of light.
#pragma once

#include <vector>

#include "protocol/calibration.h"

namespace nodal::table {

/// The blend multiplies encoded values, but gain and vignetting act on light. Where encoded = light^(1/gamma)
/// (a linear response has gamma 1) light * f is encoded * f^(1/gamma), and the factor f^(-1/gamma) undoes it
/// exactly, at every level. An sRGB or polynomial response has no such factor; then the one that errs least is
/// taken: least squares over all encoded values that the change does not clip.
///
/// Threading: immutable.
class EncodedGain {
 public:
  /// Of a linear response.
  EncodedGain() = default;
  explicit EncodedGain(const Response& response);

  /// The factor on encoded values that undoes light * `factor`. Factors are taken as within 1/8 .. 8.
  double undo(double factor) const;

 private:
  double exponent_ = -1;
  std::vector<double> fitted_;  ///< by log2(factor), evenly from -3 to 3; empty where the power is exact
};

}  // namespace nodal::table
