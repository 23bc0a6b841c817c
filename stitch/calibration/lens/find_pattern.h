// Finds the pattern in a photograph at any distance, rotation and distortion.
#pragma once

#include <string>
#include <vector>

#include "protocol/base/result.h"
#include "stitch/calibration/lens/features.h"
#include "stitch/calibration/lens/grey_image.h"
#include "stitch/calibration/lens/pattern.h"
#include "stitch/calibration/lens/start.h"

namespace nodal::calibration {

/// Threading: immutable after construction.
class PatternFinder {
 public:
  explicit PatternFinder(const PatternRaster& pattern);

  /// Matches photograph and pattern, and finds the radial pose that most matches fit.
  /// Errors: kNotDetermined, naming the photograph.
  Result<RadialPose> find(const GreyImage& photo, const std::string& name, const Eigen::Vector2d& center,
                          double aspect) const;

 private:
  Features features_;
  double px_ = 1;  // px of the pattern per pixel of the picture in which features_ were found
  int width_;
  int height_;
};

}  // namespace nodal::calibration
