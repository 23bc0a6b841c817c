// Raymaps on the flat triangles of regular polyhedra, which fill the picture.
#pragma once

#include <Eigen/Core>
#include <array>
#include <vector>

#include "stitch/geometry/raymap/layout.h"

namespace nodal::geometry {

/// How the places on a face are spread over its triangle in the picture; both in barycentric coordinates, which sum to
/// 1.
///
/// Threading: immutable; any thread.
class FaceScale {
 public:
  virtual Eigen::Vector3d to_map(const Eigen::Vector3d& face) const = 0;
  virtual Eigen::Vector3d from_map(const Eigen::Vector3d& map) const = 0;

 protected:
  ~FaceScale() = default;
};

/// Triangles of the picture, each an image (affine, without a FaceScale) of a triangle in space that rays are projected
/// on from the nodal point (gnomonic). A triangle spans 2 atan2(a . (b x c), 1 + a b + b c + c a) sr with a, b, c the
/// rays of its corners (Van Oosterom and Strackee 1983); a pixel is the sum of its parts in all triangles. With h the
/// distance of the faces from the nodal point, where pixels are largest, they span (their area on the face) / h^2.
class Polyhedron final : public RaymapLayout {
 public:
  struct Corner {
    Pixel at;  ///< position in a picture whose width and height are 1
    Eigen::Vector3d point;
  };
  using Triangle = std::array<Corner, 3>;

  /// `triangles` must fill the sphere, parts beyond the picture left out, without overlap. `scale` must live longer
  /// than the layout, and leave the edges of faces in place as a whole; null: none.
  Polyhedron(std::string_view name, RaymapSize size, const std::vector<Triangle>& triangles,
             const FaceScale* scale = nullptr);

  std::string_view name() const override { return name_; }
  bool scattered() const override { return false; }
  /// Not with a scale: such faces leave gaps, which can reach into a square of pixels whose corners are all on faces.
  bool smooth() const override { return scale_ == nullptr; }
  std::optional<Ray> ray(double x, double y) const override;
  double solid_angle(int i, int j) const override;
  std::optional<Pixel> pixel(const Ray& ray) const override;
  std::vector<LayoutPatch> patches() const override;

 private:
  struct Face {
    std::array<Pixel, 3> corners;  ///< px
    double left, right, top, bottom;
    Eigen::Matrix3d space;                          ///< the corners; columns
    Eigen::Matrix3d picture;                        ///< the same, as (x, y, 1)
    Eigen::Matrix3d face_of_space, map_of_picture;  ///< barycentric coordinates: the inverses
    Eigen::Vector3d normal;                         ///< outwards; its length is 1 / distance
  };
  Eigen::Vector3d point_of(const Face& face, const Pixel& at) const;
  double part(const Face& face, int i, int j) const;

  std::string_view name_;
  std::vector<Face> faces_;
  const FaceScale* scale_;
};

/// A face plane's distance from the centre of an icosahedron with edges of length 1.
inline constexpr double kIcosahedronInradius = 0.7557613140761708;

/// The octahedron, unfolded to a square: forward in the middle, backward in the corners (Engelhardt and Dachsbacher
/// 2008).
Result<std::unique_ptr<RaymapLayout>> make_octahedron(RaymapSize size, std::int64_t);
/// One row of triangles, a half one at each end.
Result<std::unique_ptr<RaymapLayout>> make_tetrahedron(RaymapSize size, std::int64_t);
/// Two rows of triangles, half ones at the ends: the ten about the horizon; the caps of the north pole upright with
/// those of the south pole between them.
Result<std::unique_ptr<RaymapLayout>> make_icosahedron(RaymapSize size, std::int64_t);

}  // namespace nodal::geometry
