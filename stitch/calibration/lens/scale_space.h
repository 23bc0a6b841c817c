// A picture at every blur, for comparison with photographs from any distance.
#pragma once

#include <vector>

#include "stitch/calibration/lens/grey_image.h"

namespace nodal::calibration {

/// The picture convolved with a Gaussian of `sigma` px; edges are repeated.
GreyImage blurred(const GreyImage& image, double sigma);

/// Half the size, after a low-pass filter against aliasing (kLevelSigma to kLevelSigma). Point (x, y) becomes (x/2,
/// y/2). Odd sides lose their last row or column.
GreyImage halved(const GreyImage& image);

/// Blur of every level, in that level's own pixels.
inline constexpr double kLevelSigma = 0.9;

/// Level k is the picture at 1/2^k of its size with a total blur of kLevelSigma * 2^k px of the original.
///
/// Threading: immutable after construction.
class ScaleSpace {
 public:
  /// `image` should not be blurred yet.
  explicit ScaleSpace(const GreyImage& image);

  struct Sample {
    double value = 0;
    double dx = 0;  ///< per px of the original
    double dy = 0;
    double dscale = 0;  ///< per doubling of the blur
  };
  /// The picture at a point, blurred by `sigma` px of the original (at least kLevelSigma): cubic between samples,
  /// linear between levels. Beyond the edge the edge sample is repeated.
  Sample at(double x, double y, double sigma) const;

  const GreyImage& level(int k) const { return levels_[static_cast<std::size_t>(k)]; }
  int levels() const { return static_cast<int>(levels_.size()); }

 private:
  std::vector<GreyImage> levels_;
};

}  // namespace nodal::calibration
