// Feature points (scale-space extrema with descriptors) that match a photograph with the pattern.
// Only a start for the dense alignment: exact to about a pixel, and some matches are wrong.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "stitch/calibration/lens/grey_image.h"

namespace nodal::calibration {

/// A blob: an extremum of the difference of Gaussians over place and scale (Lowe 2004).
struct Feature {
  double x = 0;  ///< px of the picture
  double y = 0;
  double sigma = 0;  ///< px
  double angle = 0;  ///< of the strongest gradient about it, rad
};

inline constexpr int kDescriptorSize = 128;

struct Features {
  std::vector<Feature> points;
  /// One column a point, of length 1: gradients by 4 x 4 places and 8 directions, turned by the point's angle.
  Eigen::MatrixXf descriptors;
};

/// At most `most` points, those of the greatest contrast.
Features find_features(const GreyImage& image, int most);

/// That point `photo` of a photograph is point `pattern` of the pattern, if it is right.
struct Match {
  int photo = 0;
  int pattern = 0;
};

/// The unambiguous matches: points whose best match in the pattern is clearly better than the second best.
std::vector<Match> match_features(const Features& photo, const Features& pattern);

}  // namespace nodal::calibration
