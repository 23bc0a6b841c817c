// One head's lens from photographs of the pattern (§4.3): finds the pattern, then aligns all photographs per pixel.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "protocol/base/result.h"
#include "protocol/calibration.h"
#include "stitch/calibration/lens/corner_views.h"
#include "stitch/calibration/lens/dense.h"
#include "stitch/calibration/lens/grey_image.h"
#include "stitch/calibration/lens/lens_model.h"
#include "stitch/calibration/lens/pattern.h"

namespace nodal::calibration {

/// A photograph of the pattern: its encoded luma, 0..1. All photographs of one head have the same size.
struct LensPhotograph {
  std::string name;
  GreyImage luma;
};

struct LensOptions {
  LensKind kind = LensKind::kTsai;
  std::string head_name = "head0";
  /// Start value of f_y / f_x, and whether it is known exactly.
  double aspect = 1;
  bool aspect_known = false;
  solve::ForEach for_each = solve::one_by_one;
  /// Called after each stage with the stage's name and the progress, 0..1.
  std::function<void(const std::string& what, double done)> progress;
};

/// A value with its standard deviation.
struct Measured {
  double value = 0;
  double deviation = 0;
};

/// What the calibration found for one photograph.
struct ViewReport {
  std::string name;
  int pairs = 0;         ///< matches that agree with the first estimate
  double tilt_deg = 0;   ///< between the pattern's normal and the lens's axis
  double distance = 0;   ///< distance of the pattern's plane, in pattern widths
  double blur_px = 0;    ///< sigma
  double covered = 0;    ///< share of the region that shows the pattern
  double explained = 0;  ///< share of the photograph's variance that the fit explains
  double rms = 0;        ///< rms of the residuals, in 1/255 of the range
  double rms_px = 0;     ///< rms of the corners' distances from where the lens shows them
  double gain = 1;       ///< brightness of its light relative to the brightest photograph's
};

struct LensReport {
  std::vector<ViewReport> views;
  Measured center_x, center_y, aspect;  ///< px
  Measured focal;                       ///< px; px per rad for fisheyes
  double mapping_deviation_px = 0;      ///< standard deviation of a ray's pixel, rms over the region
  double covered = 0;                   ///< share of the region that at least one photograph covers
  /// Distances from the lens's centre that photographs cover, px; beyond them the lens is extrapolated.
  double seen_from_px = 0, seen_to_px = 0;
  std::vector<std::string> notes;    ///< remarks for the user, one sentence each
  std::vector<GreyImage> residuals;  ///< one image per photograph, for a range of 1; 0 outside the pattern
};

struct LensCalibration {
  HeadCalibration head;
  LensReport report;
};

/// Errors, which name the photograph if there is one: kBadValue for photographs of different sizes; kNotDetermined for
/// fewer than two photographs, if one does not show the pattern, if all are taken head on or from one place, or if they
/// are inconsistent.
Result<LensCalibration> calibrate_lens(const std::vector<LensPhotograph>& photographs, const PatternRaster& pattern,
                                       const LensOptions& options);

/// The same from corners of a flat board: lens and centre; nothing is measured of the light, so photographs are taken
/// for sRGB.
/// Errors, which name the photograph if there is one: kNotDetermined as above, and for corners that no lens of this
/// kind shows there; kBadValue for fewer than kMinPairs corners.
Result<LensCalibration> calibrate_on_corners(std::vector<CornerView> views, int width, int height,
                                             const LensOptions& options);

}  // namespace nodal::calibration
