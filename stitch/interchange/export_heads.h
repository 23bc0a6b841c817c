// Common to the writers of all formats: sampled heads, fits, and numbers that read back exactly.
#pragma once

#include <string>
#include <vector>

#include "protocol/base/result.h"
#include "stitch/geometry/head.h"
#include "stitch/interchange/export.h"
#include "stitch/interchange/head_fit.h"

namespace nodal::interchange {

/// The shortest text that reads back as the same double.
std::string exact(double value);

/// A head and its projection, sampled as pairs of ray and pixel.
struct SampledHead {
  geometry::Head head;
  std::vector<geometry::RayPixel> samples;
  double farthest_angle = 0;  ///< largest angle from the axis of a sample, rad
  std::string image;

  const HeadCalibration& calibration() const { return head.calibration(); }
};

/// Samples all heads for the fits. With square_pixels every head is one of a picture resampled to square pixels; notes
/// describe the resampling.
Result<std::vector<SampledHead>> sampled_heads(const Calibration& calibration, const ExportOptions& options,
                                               ExportResult& result);

/// The better of the fits in the given bases.
/// Errors: kUnsupported, naming the head, if the lens sees rays that none of the bases can represent.
Result<PolynomialHead> best_fit(const SampledHead& head, const std::vector<RadialBasis>& bases,
                                const std::vector<int>& exponents, const FitFreedom& freedom);

/// Records a fit's residual; adds a note with `why` if it is more than rounding.
void tell_fit(const SampledHead& head, const PolynomialHead& fit, const std::string& why, ExportResult& result);

/// Adds a note that a format with square pixels only absorbs the aspect into the fit.
void tell_aspect(const std::vector<SampledHead>& heads, ExportResult& result);

/// Adds a note about the radiometry that the file does not hold.
void tell_radiometry(const Calibration& calibration, bool holds_gain_and_vignetting, ExportResult& result);

// One writer per format.
Status export_hugin(const Calibration& calibration, std::vector<SampledHead>& heads, ExportResult& result);
Status export_ptgui(const Calibration& calibration, std::vector<SampledHead>& heads, ExportResult& result);
Status export_videostitch(const Calibration& calibration, std::vector<SampledHead>& heads, ExportResult& result);
Status export_surround360(const Calibration& calibration, std::vector<SampledHead>& heads, ExportResult& result);
Status export_opencv(const Calibration& calibration, std::vector<SampledHead>& heads, ExportResult& result);
Status export_kalibr(const Calibration& calibration, std::vector<SampledHead>& heads, ExportResult& result);

}  // namespace nodal::interchange
