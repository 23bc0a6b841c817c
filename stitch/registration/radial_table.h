// A lens as the kernel reads it: everything radial, tabulated over t = sin(a / 2), a the angle from the axis.
#pragma once

#include <vector>

#include "protocol/base/result.h"
#include "protocol/calibration.h"

namespace nodal::registration {

/// Radial coefficients that are sought for a lens, beside its focal length.
int radial_count(const LensModel& lens);

/// The lens with its focal length times exp(log_focal) and its radial coefficients moved. One unit of a coefficient
/// moves the picture's edge, `edge_radius` px from the centre at `edge_angle`, by about one pixel.
LensModel changed_lens(const LensModel& lens, double log_focal, const std::vector<double>& radial, double edge_angle,
                       double edge_radius);

/// With (x, y, z) a unit ray in the head's frame: u = c_x + q(t) x, v = c_y + a_y q(t) y, q = r / sin a. In t the
/// function is smooth for every lens model, odd powers or even; sqrt is all the kernel needs.
///
/// Threading: immutable after make().
class RadialTable {
 public:
  static constexpr int kCells = 768;

  struct Node {
    float q, slope;  ///< slope: dq/dt per cell
  };

  /// Covers angles up to `max_angle`, rad. With `derivatives`, how q moves with log focal and each coefficient.
  /// Errors: kLensDomain when the lens does not rise up to there.
  static Result<RadialTable> make(const LensModel& lens, double max_angle, double edge_angle, double edge_radius,
                                  bool derivatives);

  float cells_per_t() const { return cells_per_t_; }
  float max_t() const { return max_t_; }
  /// kCells + 2 of each, so that a cell's right end can always be read.
  const Node* nodes() const { return nodes_.data(); }
  /// Original pixels per steradian (§4.2), aspect left out.
  const float* density() const { return density_.data(); }
  /// dq of one unit: 0 log focal, then the radial coefficients.
  const float* derivative(int k) const { return derivatives_[static_cast<std::size_t>(k)].data(); }

 private:
  float cells_per_t_ = 0;
  float max_t_ = 0;
  std::vector<Node> nodes_;
  std::vector<float> density_;
  std::vector<std::vector<float>> derivatives_;
};

}  // namespace nodal::registration
