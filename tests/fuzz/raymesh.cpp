// Mesh files: the first letter says the format (O, G or M). An accepted mesh has finite numbers and indices that exist,
// can be seen by a camera from anywhere, and a .glb that is written and read again is the same mesh.
#include <vector>

#include "memory_limit.h"
#include "stitch/mesh/mesh_file.h"
#include "stitch/mesh/rasteriser.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace nodal;
  static const parallel::Workers workers(1);  // before the limit: its thread has a stack
  static const bool limited = (fuzz::limit_memory(std::size_t{96} << 20), true);
  (void)limited;
  if (size == 0 || size > (1U << 16)) return 0;
  const mesh::MeshFormat format = data[0] == 'O'   ? mesh::MeshFormat::kObj
                                  : data[0] == 'G' ? mesh::MeshFormat::kGlb
                                                   : mesh::MeshFormat::kMshp;
  const auto mesh = mesh::decode_mesh({data + 1, size - 1}, format);
  if (!mesh) {
    NODAL_ASSERT(!mesh.error().message.empty() && mesh.error().message.size() < 2000);
    return 0;
  }
  NODAL_ASSERT(!mesh->triangles.empty() && mesh->triangles.size() <= mesh::kMaxMeshTriangles);
  for (const mesh::Raymesh::Triangle& triangle : mesh->triangles) {
    for (const std::uint32_t vertex : triangle) {
      NODAL_ASSERT(vertex < mesh->vertices.size() && mesh->vertices[vertex].point < mesh->points.size());
      NODAL_ASSERT(mesh->point(vertex).allFinite() && mesh->vertices[vertex].texture.allFinite());
    }
  }
  const DecodedImage raymap{PixelFormat::kGrey8, 4, 2, std::vector<std::uint8_t>(8, 100)};
  for (const Eigen::Vector3d& eye :
       {Eigen::Vector3d(0, 0, 0), Eigen::Vector3d(mesh->points[0]), Eigen::Vector3d(3, -2, -9)}) {
    const auto view = mesh::MeshView::make(*mesh, {{view::Projection::kPerspective}, {}, 90, 9, 7}, eye, workers);
    NODAL_ASSERT(view);
    for (const std::uint8_t level : view->paint(raymap.view(), false, workers).bytes)
      NODAL_ASSERT(level == 0 || level == 100);
  }
  if (format != mesh::MeshFormat::kGlb) return 0;
  const auto again = mesh::decode_mesh(mesh::encode_mesh(*mesh, format, "a.png").value(), format);
  NODAL_ASSERT(again && again->triangles == mesh->triangles && again->points == mesh->points);
  return 0;
}
