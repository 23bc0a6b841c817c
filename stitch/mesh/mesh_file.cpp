#include "stitch/mesh/mesh_file.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <utility>

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
      text += " " + std::to_string(mesh.vertices[vertex].point + 1) + "/" + std::to_string(vertex + 1);
    text += "\n";
  }
  return {text.begin(), text.end()};
}

Result<FileMesh> decode_obj(std::span<const std::uint8_t> bytes) {
  const std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  const Result<geometry::ObjMesh> obj = geometry::read_obj(text, kMaxMeshFileBytes, kMaxMeshTriangles);
  if (!obj) return fail(obj.error());
  FileMesh mesh;
  for (const geometry::ObjMesh::Triangle& triangle : obj->triangles) {
    std::array<std::uint32_t, 3> made{};
    for (std::size_t k = 0; k < 3; ++k) {
      const geometry::ObjMesh::Corner& corner = triangle.corners[k];
      if (corner.texture == geometry::ObjMesh::kNone) {
        return fail(Errc::kMissingField, "line " + std::to_string(triangle.line) +
                                             ": the face has no texture coordinates (f v/vt ...); of a mesh without "
                                             "them, only the shape can be used: --envelope");
      }
      made[k] = static_cast<std::uint32_t>(mesh.points.size());
      mesh.points.push_back(obj->vertices[corner.vertex]);
      const Eigen::Vector2d& texture = obj->textures[corner.texture];
      mesh.textures.emplace_back(texture.x(), 1 - texture.y());
    }
    mesh.triangles.push_back(made);
  }
  return mesh;
}

}  // namespace

Result<MeshFormat> mesh_format_of_name(std::string_view name) {
  if (name.ends_with(".obj")) return MeshFormat::kObj;
  if (name.ends_with(".glb")) return MeshFormat::kGlb;
  if (name.ends_with(".mshp")) return MeshFormat::kMshp;
  return fail(Errc::kUnsupported,
              std::string(name.substr(0, 256)) + ": the name of a mesh ends with .obj, .glb or .mshp");
}

Result<std::vector<std::uint8_t>> encode_mesh(const Raymesh& mesh, MeshFormat format, const std::string& texture) {
  if (format == MeshFormat::kGlb) return encode_glb(mesh, texture);
  if (format == MeshFormat::kMshp) return encode_mshp(mesh);
  return encode_obj(mesh);
}

Result<Raymesh> decode_mesh(std::span<const std::uint8_t> bytes, MeshFormat format) {
  if (bytes.size() > kMaxMeshFileBytes)
    return fail(Errc::kTooLarge, "more than " + std::to_string(kMaxMeshFileBytes) + " bytes: simplify the mesh");
  const Result<FileMesh> file = format == MeshFormat::kGlb    ? decode_glb(bytes)
                                : format == MeshFormat::kMshp ? decode_mshp(bytes)
                                                              : decode_obj(bytes);
  if (!file) return fail(file.error());
  double reach = 0;
  for (std::size_t k = 0; k < file->points.size(); ++k) {
    const double far = file->points[k].cwiseAbs().maxCoeff();
    if (!file->points[k].allFinite() || !file->textures[k].allFinite() || far > 1e6 ||
        file->textures[k].cwiseAbs().maxCoeff() > 1e3) {
      return fail(Errc::kBadValue, "vertex " + std::to_string(k + 1) +
                                       ": its place must be metres up to 1e6, its texture coordinates up to 1000");
    }
    reach = std::max(reach, far);
  }
  if (file->triangles.empty()) return fail(Errc::kBadFormat, "there is no triangle in it");
  if (reach < 1e-6) return fail(Errc::kBadValue, "all its points are at the nodal point (0, 0, 0)");
  Raymesh mesh;
  Welder welder(mesh.points, 1e-6 * reach);
  for (std::size_t k = 0; k < file->points.size(); ++k)
    mesh.vertices.push_back({welder.add(file->points[k]), file->textures[k]});
  mesh.triangles = file->triangles;
  if (const Status good = check_raymesh(mesh); !good) return fail(good.error());
  return mesh;
}

}  // namespace nodal::mesh
