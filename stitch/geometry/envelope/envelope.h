// Envelopes: surfaces that each ray from the nodal point meets once (§3.1).
#pragma once

#include <Eigen/Core>
#include <optional>
#include <string_view>
#include <vector>

#include "protocol/base/result.h"
#include "stitch/geometry/envelope/obj.h"
#include "stitch/geometry/envelope/solid.h"
#include "stitch/geometry/envelope/triangle_tree.h"
#include "stitch/geometry/ray.h"

namespace nodal::geometry {

/// A convex solid about the nodal point, or a mesh of triangles around it. Lengths in metres, axes as of rays. The
/// surface is opaque: an eye inside sees the inner side, an eye outside the outer side of its near part.
///
/// Threading: immutable; any thread.
class Envelope {
 public:
  static constexpr std::size_t kMaxObjBytes = 1 << 20;
  static constexpr std::size_t kMaxTriangles = 4096;

  /// A shape and its sizes, as Solid::named() takes them. Errors: those of Solid::named().
  static Result<Envelope> named(std::string_view text);
  /// A Wavefront OBJ, as read_obj() takes it. Which side of a face is which does not matter.
  /// Errors: those of read_obj(); kBadValue, with the line of the face, for a mesh with a hole or a fold, or that hides
  /// a part of itself from the nodal point.
  static Result<Envelope> from_obj(std::string_view text);
  /// The same of a mesh that was read. Errors: kTooLarge for more than kMaxTriangles.
  static Result<Envelope> from_mesh(const ObjMesh& mesh);

  /// Errors: kBadValue for an eye on the surface, or inside and not in the kernel; the message names a face that it
  /// would see from behind. A solid's kernel is its whole inside.
  Status check_eye(const Eigen::Vector3d& eye) const;
  /// The point that an eye sees in a direction; nothing where it looks past the envelope, from outside only.
  std::optional<Eigen::Vector3d> seen(const Eigen::Vector3d& eye, const Ray& direction) const;
  /// The radial function: how far the surface is from the nodal point.
  double rho(const Ray& ray) const;

 private:
  std::optional<double> first_hit(const Eigen::Vector3d& from, const Eigen::Vector3d& direction) const;

  std::optional<Solid> solid_;  ///< nothing: the mesh
  TriangleTree mesh_;           ///< corners counter-clockwise about outward normals
  std::vector<int> lines_;      ///< where each triangle is in the file, counted in `counted_`
  std::string_view counted_;    ///< ObjMesh::counted
};

}  // namespace nodal::geometry
