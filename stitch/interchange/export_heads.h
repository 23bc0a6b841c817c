// What the writers of all formats share: heads sampled once, fits, and numbers that read back the same.
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

/// A head with what it does to rays.
struct SampledHead {
  geometry::Head head;
  std::vector<geometry::RayPixel> samples;
  double farthest_angle = 0;  ///< rad, of the samples
  std::string image;

  const HeadCalibration& calibration() const { return head.calibration(); }
};

/// Heads ready to be fitted. With square_pixels every head is that of a picture resampled to square pixels;
/// notes say how.
Result<std::vector<SampledHead>> sampled_heads(const Calibration& calibration, const ExportOptions& options,
                                               ExportResult& result);

/// The better of the fits in the given bases. Errors: kUnsupported, naming the head, when the lens sees rays
/// that none of the bases holds.
Result<PolynomialHead> best_fit(const SampledHead& head, const std::vector<RadialBasis>& bases,
                                const std::vector<int>& exponents, const FitFreedom& freedom);

/// Records a fit's residual, with `why` in a note when it is more than rounding.
void tell_fit(const SampledHead& head, const PolynomialHead& fit, const std::string& why, ExportResult& result);

/// Notes that oblong pixels were squeezed into a format that knows only square ones.
void tell_aspect(const std::vector<SampledHead>& heads, ExportResult& result);

/// Notes what radiometry the file does not hold.
void tell_radiometry(const Calibration& calibration, bool holds_gain_and_vignetting, ExportResult& result);

// One a format.
Status export_hugin(const Calibration& calibration, std::vector<SampledHead>& heads, ExportResult& result);
Status export_ptgui(const Calibration& calibration, std::vector<SampledHead>& heads, ExportResult& result);
Status export_videostitch(const Calibration& calibration, std::vector<SampledHead>& heads, ExportResult& result);
Status export_surround360(const Calibration& calibration, std::vector<SampledHead>& heads, ExportResult& result);
Status export_opencv(const Calibration& calibration, std::vector<SampledHead>& heads, ExportResult& result);
Status export_kalibr(const Calibration& calibration, std::vector<SampledHead>& heads, ExportResult& result);

}  // namespace nodal::interchange
