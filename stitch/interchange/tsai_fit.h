// Fits a Tsai lens to pairs of ray and pixel. Its polynomial maps the picture to the ideal picture, so it fits other
// programs' lenses of this kind better than any polynomial in the other direction.
#pragma once

#include <optional>
#include <vector>

#include "protocol/calibration.h"
#include "stitch/interchange/head_fit.h"

namespace nodal::interchange {

struct TsaiFit {
  TsaiLens lens;
  double rms_px = 0;
  double max_px = 0;
};

/// The centre is given and not fitted. Nothing if the fitted lens does not rise over the samples, or if a ray is 90
/// degrees or more from the axis.
std::optional<TsaiFit> fit_tsai(const std::vector<geometry::RayPixel>& samples, double cx, double cy, double aspect);

}  // namespace nodal::interchange
