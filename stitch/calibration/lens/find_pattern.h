// Finds the pattern in a photograph, however far off, turned or bent by the lens.
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

  /// Which places of the photograph show which of the pattern, and the radial pose they agree on.
  /// Errors: kNotDetermined, naming the photograph.
  Result<RadialPose> find(const GreyImage& photo, const std::string& name, const Eigen::Vector2d& center,
                          double aspect) const;

 private:
  Features features_;
  double px_ = 1;  // of the pattern in one pixel of the picture that features_ were found in
  int width_;
  int height_;
};

}  // namespace nodal::calibration
