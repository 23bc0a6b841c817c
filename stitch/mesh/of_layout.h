// The raymesh of a layout.
#pragma once

#include "protocol/base/result.h"
#include "stitch/geometry/envelope/envelope.h"
#include "stitch/geometry/raymap/layout.h"
#include "stitch/mesh/raymesh.h"

namespace nodal::mesh {

struct LayoutMesh {
  Raymesh mesh;
  /// The largest angle, rad, between the direction of a point of a triangle and the layout's ray at the place that is
  /// interpolated linearly between the corners' places; over 28 points of each triangle. 0 for a scattered layout.
  double error = 0;
};

/// Makes as few triangles on an envelope as keep the error within `most_error` rad: patches of the layout, each cut
/// evenly, so that neighbours meet at their corners. The mesh of an icosahedron or dymaxion is a subdivided
/// icosahedron. That of a scattered layout has the spherical Delaunay triangles of its rays (the convex hull of their
/// directions); such a raymap has no places between the corners, so the corners' values must be interpolated.
/// Errors: kTooLarge if more than kMaxMeshTriangles would be needed.
Result<LayoutMesh> mesh_of_layout(const geometry::RaymapLayout& layout, const geometry::Envelope& envelope,
                                  double most_error);

}  // namespace nodal::mesh
