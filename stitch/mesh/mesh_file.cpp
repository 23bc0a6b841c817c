#include "stitch/mesh/mesh_file.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <utility>

#include "protocol/base/file_ending.h"
#include "protocol/base/try.h"
#include "stitch/geometry/envelope/obj.h"
#include "stitch/mesh/formats.h"

namespace nodal::mesh {
namespace {

std::string line(const char* kind, const double* numbers, int count) {
  std::string text = kind;
  for (int k = 0; k < count; ++k) {
    char number[32];
    std::snprintf(number, sizeof number, " %.9g", numbers[k]);
    text += number;
  }
  return text + "\n";
}

/// Points (v) are shared across seams and texture coordinates (vt) are not: the surface is closed, its texture is cut.
std::vector<std::uint8_t> encode_obj(const Raymesh& mesh) {
  std::string text =
      "# a raymesh: metres, x to the right, y down, z forward; vt from the lower left corner of the raymap\n";
  for (const Eigen::Vector3d& point : mesh.points) text += line("v", point.data(), 3);
  for (const Raymesh::Vertex& vertex : mesh.vertices) {
    const Eigen::Vector2d upwards(vertex.texture.x(), 1 - vertex.texture.y());
    text += line("vt", upwards.data(), 2);
  }
  for (const Raymesh::Triangle& triangle : mesh.triangles) {
    text += "f";
    for (const std::uint32_t vertex : triangle)
      text += fmt::format(" {}/{}", mesh.vertices[vertex].point + 1, vertex + 1);
    text += "\n";
  }
  return {text.begin(), text.end()};
}

Result<FileMesh> decode_obj(std::span<const std::uint8_t> bytes) {
  const std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  NODAL_TRY_ASSIGN(const geometry::ObjMesh obj, geometry::read_obj(text, kMaxMeshFileBytes, kMaxMeshTriangles));
  FileMesh mesh;
  for (const geometry::ObjMesh::Triangle& triangle : obj.triangles) {
    std::array<std::uint32_t, 3> made{};
    for (std::size_t k = 0; k < 3; ++k) {
      const geometry::ObjMesh::Corner& corner = triangle.corners[k];
      if (corner.texture == geometry::ObjMesh::kNone) {
        return fail(Errc::kMissingField, fmt::format("line {}: the face has no texture coordinates (f v/vt ...); of a "
                                                     "mesh without them, only the shape can be used: --envelope",
                                                     triangle.line));
      }
      made[k] = static_cast<std::uint32_t>(mesh.points.size());
      mesh.points.push_back(obj.vertices[corner.vertex]);
      const Eigen::Vector2d& texture = obj.textures[corner.texture];
      mesh.textures.emplace_back(texture.x(), 1 - texture.y());
    }
    mesh.triangles.push_back(made);
  }
  return mesh;
}

Status check_size(std::span<const std::uint8_t> bytes) {
  if (bytes.size() <= kMaxMeshFileBytes) return {};
  return fail(Errc::kTooLarge, fmt::format("more than {} bytes: simplify the mesh", kMaxMeshFileBytes));
}

/// Makes points that are equal to a millionth of the farthest one's distance one, and returns for each of the file's
/// points which one it is.
Result<std::vector<std::uint32_t>> weld(const FileMesh& file, std::vector<Eigen::Vector3d>& points) {
  double reach = 0;
  for (std::size_t k = 0; k < file.points.size(); ++k) {
    const double far = file.points[k].cwiseAbs().maxCoeff();
    if (!file.points[k].allFinite() || !file.textures[k].allFinite() || far > 1e6 ||
        file.textures[k].cwiseAbs().maxCoeff() > 1e3) {
      return fail(
          Errc::kBadValue,
          fmt::format("vertex {}: its place must be metres up to 1e6, its texture coordinates up to 1000", k + 1));
    }
    reach = std::max(reach, far);
  }
  if (file.triangles.empty()) return fail(Errc::kBadFormat, "there is no triangle in it");
  if (reach < 1e-6) return fail(Errc::kBadValue, "all its points are at the nodal point (0, 0, 0)");
  Welder welder(points, 1e-6 * reach);
  std::vector<std::uint32_t> places;
  for (const Eigen::Vector3d& point : file.points) places.push_back(welder.add(point));
  return places;
}

}  // namespace

Result<MeshFormat> mesh_format_of_name(std::string_view name) {
  if (has_ending(name, ".obj")) return MeshFormat::kObj;
  if (has_ending(name, ".glb")) return MeshFormat::kGlb;
  if (has_ending(name, ".mshp")) return MeshFormat::kMshp;
  return fail(Errc::kUnsupported,
              std::string(name.substr(0, 256)) + ": the name of a mesh ends with .obj, .glb or .mshp");
}

Result<std::vector<std::uint8_t>> encode_mesh(const Raymesh& mesh, MeshFormat format, const std::string& texture) {
  if (format == MeshFormat::kGlb) return encode_glb(mesh, texture);
  if (format == MeshFormat::kMshp) return encode_mshp(mesh);
  return encode_obj(mesh);
}

Result<Raymesh> decode_mesh(std::span<const std::uint8_t> bytes, MeshFormat format) {
  NODAL_TRY(check_size(bytes));
  NODAL_TRY_ASSIGN(const FileMesh file, format == MeshFormat::kGlb    ? decode_glb(bytes, true)
                                        : format == MeshFormat::kMshp ? decode_mshp(bytes)
                                                                      : decode_obj(bytes));
  Raymesh mesh;
  NODAL_TRY_ASSIGN(const std::vector<std::uint32_t> places, weld(file, mesh.points));
  for (std::size_t k = 0; k < places.size(); ++k) mesh.vertices.push_back({places[k], file.textures[k]});
  mesh.triangles = file.triangles;
  NODAL_TRY(check_raymesh(mesh));
  return mesh;
}

Result<geometry::Envelope> decode_envelope(std::span<const std::uint8_t> glb) {
  NODAL_TRY(check_size(glb));
  NODAL_TRY_ASSIGN(const FileMesh file, decode_glb(glb, false));
  geometry::ObjMesh mesh;
  mesh.counted = "triangle";
  NODAL_TRY_ASSIGN(const std::vector<std::uint32_t> places, weld(file, mesh.vertices));
  for (std::size_t k = 0; k < file.triangles.size(); ++k) {
    geometry::ObjMesh::Triangle triangle;
    triangle.line = static_cast<int>(k) + 1;
    for (std::size_t c = 0; c < 3; ++c) {
      triangle.corners[c] = {places[file.triangles[k][c]], geometry::ObjMesh::kNone};
    }
    const auto& [a, b, c] = triangle.corners;
    if (a.vertex != b.vertex && b.vertex != c.vertex && c.vertex != a.vertex) mesh.triangles.push_back(triangle);
  }
  if (mesh.triangles.empty()) return fail(Errc::kBadFormat, "none of its triangles has an area");
  return geometry::Envelope::from_mesh(mesh);
}

}  // namespace nodal::mesh
