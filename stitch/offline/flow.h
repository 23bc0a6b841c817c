// Optical flow between two pictures of the same scene from two places, for interpolating the views between them.
#pragma once

#include <cstdint>
#include <vector>

namespace nodal::offline {

/// A picture and where it shows anything.
///
/// Threading: a value.
struct SeenPicture {
  int width = 0;
  int height = 0;
  std::vector<float> levels;  ///< 0 .. 255, row by row
  std::vector<float> seen;    ///< 1, or 0 where the picture shows nothing
};

/// A displacement for each pixel, in pixels.
struct Flow {
  int width = 0;
  int height = 0;
  std::vector<float> x, y;

  /// Bilinear at (u, v), in pixels (the first one's centre is at 1/2, 1/2); beyond the edges, the edge's.
  void at(double u, double v, double& dx, double& dy) const;
};

/// The flow f for which a view between two pictures shows at p what `a` shows at p - (1 - share(p)) f(p) and `b` at
/// p + share(p) f(p). What is shorter than half a pixel is reduced, down to 0 for 0.15 px; what would fold a picture is
/// shortened (flow_limit.h).
///
/// The pictures' gradients are compared, not their levels: two heads show a surface with different brightness. The flow
/// is that of least cost: the difference of the gradients, plus the flow's own change from pixel to pixel, both as
/// absolute values, so that occlusions and edges of objects count little (Brox, Bruhn, Papenberg and Weickert, "High
/// Accuracy Optical Flow Estimation Based on a Theory for Warping", 2004); from coarse to fine pictures, by
/// over-relaxation.
///
/// share: of `a`, 0 .. 1, one number a pixel; changes little from pixel to pixel.
/// Memory: about 200 bytes a pixel.
Flow flow_between(const SeenPicture& a, const SeenPicture& b, const std::vector<float>& share);

}  // namespace nodal::offline
