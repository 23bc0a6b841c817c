// The formats of mesh files: one function to read and one to write each.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "protocol/base/result.h"
#include "stitch/mesh/raymesh.h"

namespace nodal::mesh {

/// A mesh as files have it, without shared points. Points have the rig's axes; texture coordinates begin at the upper
/// left.
struct FileMesh {
  std::vector<Eigen::Vector3d> points;
  std::vector<Eigen::Vector2d> textures;  ///< one per point
  std::vector<std::array<std::uint32_t, 3>> triangles;
};

/// From the rig's axes (x right, y down, z forward) to those of glTF and mshp (x right, y up, z backward), and back.
inline Eigen::Vector3d turned_over(const Eigen::Vector3d& p) { return {p.x(), -p.y(), -p.z()}; }

Result<std::vector<std::uint8_t>> encode_glb(const Raymesh& mesh, const std::string& texture);
/// The triangles of a .glb's scene, with the transformations of its nodes. Unless `textured`, texture coordinates are
/// not read, and those of the mesh are 0.
Result<FileMesh> decode_glb(std::span<const std::uint8_t> bytes, bool textured);

Result<std::vector<std::uint8_t>> encode_mshp(const Raymesh& mesh);
Result<FileMesh> decode_mshp(std::span<const std::uint8_t> bytes);

}  // namespace nodal::mesh
