// A lens as the kernel reads it: its radial functions as tables over t = sin(a / 2), where a is the angle from the
// axis.
#pragma once

#include <vector>

#include "protocol/base/result.h"
#include "protocol/calibration.h"

namespace nodal::registration {

/// Number of radial coefficients that are estimated for a lens besides its focal length.
int radial_count(const LensModel& lens);

/// The lens with its focal length multiplied by exp(log_focal) and its radial coefficients changed. One unit of a
/// coefficient moves the picture's edge, `edge_radius` px from the centre at `edge_angle`, by about one pixel.
LensModel changed_lens(const LensModel& lens, double log_focal, const std::vector<double>& radial, double edge_angle,
                       double edge_radius);

/// For a unit ray (x, y, z) in the head's frame: u = c_x + q(t) x, v = c_y + a_y q(t) y, q = r / sin a. As a function
/// of t, q is smooth for every lens model, with odd or even powers, and the kernel needs only a square root.
///
/// Threading: immutable after make().
class RadialTable {
 public:
  static constexpr int kCells = 768;

  struct Node {
    float q, slope;  ///< slope: dq/dt per cell
  };

  /// Covers angles up to `max_angle`, rad. `derivatives`: also the derivatives of q by log focal and each coefficient.
  /// Errors: kLensDomain if the lens is not monotonic up to there.
  static Result<RadialTable> make(const LensModel& lens, double max_angle, double edge_angle, double edge_radius,
                                  bool derivatives);

  float cells_per_t() const { return cells_per_t_; }
  float max_t() const { return max_t_; }
  /// kCells + 2 entries each, so that the right end of every cell can be read.
  const Node* nodes() const { return nodes_.data(); }
  /// Original pixels per steradian (§4.2), without the aspect.
  const float* density() const { return density_.data(); }
  /// Derivatives of q: [0] by log focal, then by the radial coefficients.
  const float* derivative(int k) const { return derivatives_[static_cast<std::size_t>(k)].data(); }

 private:
  float cells_per_t_ = 0;
  float max_t_ = 0;
  std::vector<Node> nodes_;
  std::vector<float> density_;
  std::vector<std::vector<float>> derivatives_;
};

}  // namespace nodal::registration
