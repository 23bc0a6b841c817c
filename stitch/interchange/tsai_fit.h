// The Tsai lens nearest to pairs of ray and pixel: its polynomial goes from the picture to the ideal one, so that what
// other programs write of such a lens fits it better than any polynomial the other way.
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

/// About the given centre, which is not sought. Nothing when the lens that comes out does not rise over the samples, or
/// when a ray is 90 degrees or more from the axis.
std::optional<TsaiFit> fit_tsai(const std::vector<geometry::RayPixel>& samples, double cx, double cy, double aspect);

}  // namespace nodal::interchange
