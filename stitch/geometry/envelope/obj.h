// Wavefront OBJ: vertices, texture coordinates and faces.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "protocol/base/result.h"

namespace nodal::geometry {

struct ObjMesh {
  struct Corner {
    std::uint32_t vertex = 0;
    std::uint32_t texture = 0;  ///< kNone: the face gives none
  };
  static constexpr std::uint32_t kNone = 0xFFFF'FFFF;
  struct Triangle {
    std::array<Corner, 3> corners;
    int line = 0;  ///< where it is in the file, counted in `counted`
  };
  std::vector<Eigen::Vector3d> vertices;
  std::vector<Eigen::Vector2d> textures;
  std::vector<Triangle> triangles;
  std::string_view counted = "line";  ///< what Triangle::line counts, for messages; another format's may be "triangle"
};

/// Reads the lines v, vt and f; others are skipped. Faces with more corners are cut into triangles.
/// Errors: kTooLarge beyond `most_bytes` or `most_triangles`, kBadFormat for a bad line or a file without a face;
/// messages begin with "line N: ".
Result<ObjMesh> read_obj(std::string_view text, std::size_t most_bytes, std::size_t most_triangles);

/// Refuses a mesh with a hole or a fold: each edge must belong to two triangles that run along it in opposite
/// directions. Errors: kBadValue, with the line of a face.
Status check_closed(const ObjMesh& mesh);

}  // namespace nodal::geometry
