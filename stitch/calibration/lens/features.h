// Feature points (scale-space extrema with descriptors), matched between a photograph and the pattern. Only a start for
// the dense alignment: accurate to about a pixel, and some matches are wrong.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "stitch/calibration/lens/grey_image.h"

namespace nodal::calibration {

/// A blob: an extremum of the difference of Gaussians in position and scale (Lowe 2004).
struct Feature {
  double x = 0;  ///< px of the picture
  double y = 0;
  double sigma = 0;  ///< px
  double angle = 0;  ///< direction of the strongest gradient around it, rad
};

inline constexpr int kDescriptorSize = 128;

struct Features {
  std::vector<Feature> points;
  /// One column per point, of length 1: gradients in 4 x 4 cells and 8 directions, rotated by the point's angle.
  Eigen::MatrixXf descriptors;
};

/// Finds at most `most` points: those of the highest contrast.
Features find_features(const GreyImage& image, int most);

/// A hypothesis: point `photo` of the photograph shows point `pattern` of the pattern.
struct Match {
  int photo = 0;
  int pattern = 0;
};

/// The unambiguous matches: points whose best match in the pattern is clearly better than their second best.
std::vector<Match> match_features(const Features& photo, const Features& pattern);

}  // namespace nodal::calibration
