// The free parameters: which numbers heads share, which are held, and the gauge.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "stitch/registration/head_state.h"
#include "stitch/registration/objective.h"

namespace nodal::registration {

struct Held {
  std::vector<bool> geometry;  ///< of a head: it stays where it is, with its lens
  std::vector<bool> light;     ///< of a head: its gain and fall-off stay, and are no part of the sum that is zero
  int first = 0;               ///< the head whose rotation holds the rig
  bool share_lens = false;     ///< all heads' lenses move alike
  /// Of a head: its fall-off is its own. The others' moves with the mean of these, or with one another where there are
  /// none. Empty: none.
  std::vector<bool> own_vignetting;
  bool free_gains = false;  ///< no sum of log gains is held, since some heads' light is known
};

/// The heads' numbers as a linear image of the free ones: all = B * free. Sharing, holding and the gauges (the first
/// head's rotation; log gains with sum zero, a channel) are all in B.
///
/// Threading: immutable.
class Parameters {
 public:
  Parameters(const std::vector<HeadState>& heads, const Sought& sought, const Held& held);

  int free_count() const { return static_cast<int>(basis_.cols()); }
  const std::vector<Slots>& slots() const { return slots_; }
  /// One row a number of a head: [head * stride + slot].
  const Eigen::MatrixXd& basis() const { return basis_; }
  int stride() const { return stride_; }

  Eigen::VectorXd gradient(const Normal& normal) const;
  Eigen::MatrixXd hessian(const Normal& normal, Curvature curvature) const;
  std::vector<HeadState> moved(const std::vector<HeadState>& heads, const Eigen::VectorXd& free_step) const;
  /// The largest turn of a head in a step, rad.
  double largest_turn(const Eigen::VectorXd& free_step) const;

 private:
  int stride_ = 0;
  std::vector<Slots> slots_;
  Eigen::MatrixXd basis_;
};

}  // namespace nodal::registration
