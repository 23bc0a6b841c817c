// Envelopes: surfaces that each ray from the nodal point meets once (§3.1).
#pragma once

#include <Eigen/Core>
#include <array>
#include <string_view>
#include <vector>

#include "protocol/base/result.h"
#include "stitch/geometry/ray.h"

namespace nodal::geometry {

/// A sphere about the nodal point, or a mesh of triangles around it. Lengths in metres, axes as of rays.
///
/// Threading: immutable; any thread.
class Envelope {
 public:
  static constexpr std::size_t kMaxObjBytes = 1 << 20;
  static constexpr std::size_t kMaxTriangles = 4096;

  /// Errors: kBadValue unless the radius is positive and at most 1e6 m.
  static Result<Envelope> sphere(double radius);
  /// The vertices (v) and faces (f) of a Wavefront OBJ; faces with more corners are cut into triangles, other lines are
  /// skipped. Which side is which does not matter.
  /// Errors: kTooLarge beyond the limits above; kBadFormat for lines that are none; kBadValue, with the line of the face,
  /// for a mesh with a hole or a fold, or that hides a part of itself from the nodal point.
  static Result<Envelope> from_obj(std::string_view text);

  /// Errors: kBadValue for an eye outside of the kernel; the message names a face that it would see from behind.
  Status check_eye(const Eigen::Vector3d& eye) const;
  /// The point that an eye in the kernel sees in a direction. From the origin, its length is the radial function rho.
  Eigen::Vector3d seen(const Eigen::Vector3d& eye, const Ray& direction) const;

 private:
  struct Triangle {
    std::array<Eigen::Vector3d, 3> corners;  ///< counter-clockwise about its outward normal
    int line;                                ///< of the file
  };
  double radius_ = 0;  ///< 0: a mesh
  std::vector<Triangle> triangles_;
};

}  // namespace nodal::geometry
