// Raymeshes: triangles of an envelope, with their places in a raymap (§5).
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <map>
#include <vector>

#include "protocol/base/result.h"
#include "stitch/geometry/ray.h"

namespace nodal::mesh {

inline constexpr std::size_t kMaxMeshTriangles = 1 << 18;
inline constexpr std::size_t kMaxMeshFileBytes = 64 << 20;

/// Vertices (rho, theta, phi, t_x, t_y): a point of the envelope, in metres and the rig's axes, and its place in the
/// raymap, as fractions of its width and height from the upper left corner. The left and right edges are joined.
/// At a seam of the raymap, one point has several vertices. Triangles are counter-clockwise as the nodal point sees
/// them.
struct Raymesh {
  struct Vertex {
    std::uint32_t point = 0;  ///< its index
    Eigen::Vector2d texture;
  };
  using Triangle = std::array<std::uint32_t, 3>;

  std::vector<Eigen::Vector3d> points;
  std::vector<Vertex> vertices;
  std::vector<Triangle> triangles;

  double rho(std::uint32_t vertex) const { return point(vertex).norm(); }
  geometry::Angles angles(std::uint32_t vertex) const { return geometry::Ray::towards(point(vertex)).angles(); }
  const Eigen::Vector3d& point(std::uint32_t vertex) const { return points[vertices[vertex].point]; }
};

/// Collects points; points that are nearer to each other than `same` are merged.
class Welder {
 public:
  Welder(std::vector<Eigen::Vector3d>& points, double same) : points_(points), same_(same) {}
  std::uint32_t add(const Eigen::Vector3d& point);

 private:
  using Cell = std::array<std::int64_t, 3>;
  std::vector<Eigen::Vector3d>& points_;
  double same_;
  std::map<Cell, std::uint32_t> cells_;
};

/// Refuses a mesh that is no envelope: triangles that the nodal point sees from behind or edge-on, that fold over each
/// other, or that go around the nodal point more than once. A raymesh may cover a part of the sphere. If all triangles
/// are clockwise, they are reversed. Errors: kBadValue, with the number of the triangle, from 1, in the file's order.
Status check_raymesh(Raymesh& mesh);

/// The longest edge divided by the shortest, as the nodal point sees them.
double edge_ratio(const Raymesh& mesh);

}  // namespace nodal::mesh
