// One head's lens from photographs of the pattern (§4.3): finds the pattern, then aligns all photographs per pixel.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "protocol/base/result.h"
#include "protocol/calibration.h"
#include "stitch/calibration/lens/dense.h"
#include "stitch/calibration/lens/grey_image.h"
#include "stitch/calibration/lens/lens_model.h"
#include "stitch/calibration/lens/pattern.h"

namespace nodal::calibration {

/// A photograph of the pattern: its encoded luma, 0..1. All of one head have one size.
struct LensPhotograph {
  std::string name;
  GreyImage luma;
};

struct LensOptions {
  LensKind kind = LensKind::kTsai;
  std::string head_name = "head0";
  /// f_y / f_x to start from, and whether it is known.
  double aspect = 1;
  bool aspect_known = false;
  solve::ForEach for_each = solve::one_by_one;
  /// Called after each stage with its name and the progress, 0..1.
  std::function<void(const std::string& what, double done)> progress;
};

/// A value with its standard deviation.
struct Measured {
  double value = 0;
  double deviation = 0;
};

/// The result of one photograph.
struct ViewReport {
  std::string name;
  int pairs = 0;         ///< points found and agreed on at the start
  double tilt_deg = 0;   ///< between the pattern's normal and the lens's axis
  double distance = 0;   ///< of the pattern's plane, in pattern widths
  double blur_px = 0;    ///< sigma
  double covered = 0;    ///< part of the region that shows the pattern
  double explained = 0;  ///< part of its variance
  double rms = 0;        ///< what is left, in 1/255 of the range
  double gain = 1;       ///< of its light, against the brightest photograph's
};

struct LensReport {
  std::vector<ViewReport> views;
  Measured center_x, center_y, aspect;  ///< px
  Measured focal;                       ///< px; px per rad for fisheyes
  double mapping_deviation_px = 0;      ///< standard deviation of where a ray falls, rms over the region
  double covered = 0;                   ///< part of the region that at least one photograph covers
  std::vector<std::string> notes;       ///< remarks for the user, one sentence each
  std::vector<GreyImage> residuals;     ///< the residuals of each photograph, of a range of 1; 0 off the pattern
};

struct LensCalibration {
  HeadCalibration head;
  LensReport report;
};

/// Errors, all naming the photograph where there is one: kBadValue for photographs of different sizes,
/// kNotDetermined for fewer than two photographs, when the pattern is not in one, when all are taken head on or
/// from one place, or when they do not agree.
Result<LensCalibration> calibrate_lens(const std::vector<LensPhotograph>& photographs, const PatternRaster& pattern,
                                       const LensOptions& options);

}  // namespace nodal::calibration
