// Convex envelopes with closed formulas: sphere, cylinder, paraboloids, regular polyhedra (§3.1).
#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "protocol/base/result.h"

namespace nodal::geometry {

inline constexpr double kLargestEnvelope = 1e6;  // m

/// A part of space: q . (p * p) + b . p + c <= 0, with q >= 0 and p * p taken coordinate by coordinate. A half-space
/// (q = 0), or the inside of a sphere, a cylinder or a paraboloid.
struct Quadric {
  Eigen::Vector3d q, b;
  double c = 0;

  double at(const Eigen::Vector3d& p) const { return q.dot(p.cwiseProduct(p)) + b.dot(p) + c; }
  Eigen::Vector3d gradient(const Eigen::Vector3d& p) const { return 2 * q.cwiseProduct(p) + b; }
};

/// The intersection of such parts: convex, so its kernel is its whole inside, and a line meets it in one interval.
///
/// Threading: immutable; any thread.
class Solid {
 public:
  /// A name and its sizes: "sphere:2.5", "cylinder:2,3". Errors: kUnsupported for an unknown name, kBadValue for sizes.
  static Result<Solid> named(std::string_view text);
  /// How names are written, one after the other: "sphere:RADIUS cylinder:RADIUS,HEIGHT ...".
  static std::string names();

  /// Negative inside, positive outside, 0 on the surface: near it, the distance in metres.
  double outside(const Eigen::Vector3d& point) const;
  /// Where a line from a point first meets the surface, as a multiple of `direction`; only ahead.
  std::optional<double> first_hit(const Eigen::Vector3d& from, const Eigen::Vector3d& direction) const;

 private:
  explicit Solid(std::vector<Quadric> parts) : parts_(std::move(parts)) {}

  std::vector<Quadric> parts_;
};

}  // namespace nodal::geometry
