// Views of a raymesh as textured triangles (§6).
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <vector>

#include "protocol/base/decoded_image.h"
#include "protocol/base/image.h"
#include "protocol/base/result.h"
#include "stitch/mesh/raymesh.h"
#include "stitch/parallel/workers.h"
#include "stitch/view/camera.h"

namespace nodal::mesh {

/// Finds the triangle that each pixel of a view shows, and the place in it, by drawing the triangles one after the
/// other with a depth buffer. This is independent of the search of an envelope's point for each pixel's ray.
///
/// Threading: immutable; any thread.
class MeshView {
 public:
  /// Samples the middles of pixels. `spec` is that of a perspective camera; `eye` is in metres.
  /// Errors: those of Camera::make(); kUnsupported for another projection, which shows edges as curves.
  static Result<MeshView> make(const Raymesh& mesh, const view::CameraSpec& spec, const Eigen::Vector3d& eye,
                               const parallel::Workers& workers);

  /// The place in the raymap that a pixel shows, as fractions of its width and height; nothing beside the mesh.
  std::optional<Eigen::Vector2d> texture(int x, int y) const;

  /// The view of a raymap: bilinear, with its left and right edges joined, and black beside the mesh. With
  /// `corners_only`, which raymaps of scattered layouts need, triangles show the interpolated values of the pixels at
  /// their corners. The raymap is RGB24, GREY, RGB48 or GREY16, packed; so is the view.
  DecodedImage paint(const ImageView& raymap, bool corners_only, const parallel::Workers& workers) const;

 private:
  struct Seen {
    std::uint32_t triangle = kNone;
    float second = 0, third = 0;  ///< the weights of its corners; they sum to 1
  };
  static constexpr std::uint32_t kNone = 0xFFFF'FFFF;

  template <class Sample>
  DecodedImage paint_as(const ImageView& raymap, bool corners_only, const parallel::Workers& workers) const;

  MeshView(const Raymesh& mesh, int width, int height)
      : width_(width), height_(height), pixels_(static_cast<std::size_t>(width) * static_cast<std::size_t>(height)) {
    for (const Raymesh::Triangle& t : mesh.triangles) {
      textures_.push_back({mesh.vertices[t[0]].texture, mesh.vertices[t[1]].texture, mesh.vertices[t[2]].texture});
    }
  }

  int width_, height_;
  std::vector<Seen> pixels_;
  std::vector<std::array<Eigen::Vector2d, 3>> textures_;  ///< texture coordinates of each triangle's corners
};

}  // namespace nodal::mesh
