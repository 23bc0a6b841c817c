// The free parameters: which numbers heads share, which are held, and the gauge.
#pragma once

#include <Eigen/Core>
#include <Eigen/SparseCore>
#include <vector>

#include "stitch/registration/head_state.h"
#include "stitch/registration/objective.h"

namespace nodal::registration {

struct Held {
  std::vector<bool> geometry;  ///< by head: its rotation and lens are fixed
  std::vector<bool> light;     ///< by head: its gain and fall-off are fixed, and not part of the zero sum
  int first = 0;               ///< the head whose rotation is fixed
  bool share_lens = false;     ///< one lens is estimated for all heads
  /// By head: it has its own fall-off. All other heads get the mean change of these, or, if there are none, one common
  /// change. Empty: none.
  std::vector<bool> own_vignetting;
  bool free_gains = false;  ///< the sum of log gains is free, because some heads' light is known
};

/// The heads' parameters as a linear function of the free ones: all = B * free. B contains which parameters are shared
/// or fixed, and the gauges (the first head's rotation; a zero sum of log gains per channel).
///
/// Threading: immutable.
class Parameters {
 public:
  Parameters(const std::vector<HeadState>& heads, const Sought& sought, const Held& held);

  int free_count() const { return static_cast<int>(basis_.cols()); }
  const std::vector<Slots>& slots() const { return slots_; }
  /// One row for each parameter of each head: [head * stride + slot].
  const Eigen::MatrixXd& basis() const { return basis_; }
  int stride() const { return stride_; }

  /// Which free parameters remain if only `sought` is estimated, which must be part of what is estimated here.
  std::vector<bool> part_of(const Sought& sought) const;

  /// Soft priors, half a percent of focal lengths and of the edge's radius: the inverse variances of changes of lenses,
  /// as a matrix of the free parameters. They matter only where the pictures say little, or contradict each other.
  Eigen::MatrixXd lens_weights(const std::vector<HeadState>& heads) const;

  Eigen::VectorXd gradient(const Normal& normal) const;
  Eigen::MatrixXd hessian(const Normal& normal, Curvature curvature) const;
  std::vector<HeadState> moved(const std::vector<HeadState>& heads, const Eigen::VectorXd& free_step) const;
  /// The largest turn of a head in a step, rad.
  double largest_turn(const Eigen::VectorXd& free_step) const;

 private:
  int stride_ = 0;
  std::vector<Slots> slots_;
  Eigen::MatrixXd basis_;
  Eigen::SparseMatrix<double> sparse_;  ///< the same: most of it is 0
};

}  // namespace nodal::registration
