// Small squares of heads' pictures around a ray, and how alike two of them are.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <functional>
#include <vector>

namespace nodal::offline {

inline constexpr float kNotSeen = -1;  ///< sample of a ray that the head does not see

/// A square of one head's samples around a ray, kNotSeen outside of its region.
class LightPatch {
 public:
  /// `pixel`: width of a sample, rad.
  LightPatch(int half, double pixel, const Eigen::Vector3d& axis,
             const std::function<float(const Eigen::Vector3d&, double)>& light);
  int half() const { return side_ / 2; }
  float at(int i, int j) const { return light_[static_cast<std::size_t>((j + half()) * side_ + i + half())]; }

 private:
  int side_;
  std::vector<float> light_;
};

struct Likeness {
  double shared = 0;       ///< share of the patch that both see
  double correlation = 0;  ///< -1 .. 1; 0 if one of them has no detail at all
  double detail = 0;       ///< the larger standard deviation
  double step = 0;         ///< how much brighter the second one is, where neither is clipped
};

/// The middle of `a`, `half` pixels to each side, beside `b` shifted by (x, y).
Likeness likeness(const LightPatch& a, const LightPatch& b, int half, int x, int y);

/// How much the patch's gradients have one direction (of its structure tensor: the difference of the eigenvalues, as a
/// share of their sum).
double coherence(const LightPatch& patch);

}  // namespace nodal::offline
