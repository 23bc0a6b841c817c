// The cube raymaps: six square faces in one picture.
#pragma once

#include <array>

#include "stitch/geometry/raymap/layout.h"

namespace nodal::geometry {

/// Square faces of n x n pixels. Each is the picture of a 90-degree pinhole that looks that way; `up` has its front
/// edge at the bottom and `down` at the top. With the parameter `pad`, a face has that many more pixels on every side,
/// which continue its plane, so that filters and video coders do not see the neighbour in the picture.
///
/// On the face z = 1 a pixel [x0,x1] x [y0,y1] spans A(x1,y1) - A(x0,y1) - A(x1,y0) + A(x0,y0),
/// A(x,y) = atan(x y / sqrt(1 + x^2 + y^2)). The largest, in the centre, is 4 / n^2; the smallest 3 sqrt 3 times less.
/// Equi-angular (Google's EAC): x = tan(pi u / 4) with u the place on the face, -1..1, so that the largest is
/// (pi / 2)^2 / n^2.
class Cube final : public RaymapLayout {
 public:
  /// What lies in a square of the picture.
  struct Place {
    int face = -1;   ///< right left up down front back; -1: no ray
    int turned = 0;  ///< quarter turns clockwise of the face in the picture
  };
  struct Arrangement {
    std::string_view name;
    int columns, rows;
    std::array<Place, 12> places;  ///< row by row
    bool equiangular = false;
  };

  /// In the order that players of `cbmp` boxes expect and that FFmpeg's v360 calls c3x2:
  ///   right left up
  ///   down front back
  static Result<std::unique_ptr<RaymapLayout>> make_3x2(RaymapSize size, std::int64_t pad);
  /// v360's c6x1.
  static Result<std::unique_ptr<RaymapLayout>> make_6x1(RaymapSize size, std::int64_t pad);
  ///        up
  ///   left front right back
  ///        down
  static Result<std::unique_ptr<RaymapLayout>> make_cross(RaymapSize size, std::int64_t pad);
  /// The layout that FFmpeg's v360 calls eac: left front right / down back up, the second row turned.
  static Result<std::unique_ptr<RaymapLayout>> make_equiangular(RaymapSize size, std::int64_t pad);

  std::string_view name() const override { return plan_.name; }
  bool scattered() const override { return false; }
  std::optional<Ray> ray(double x, double y) const override;
  double solid_angle(int i, int j) const override;
  std::optional<Pixel> pixel(const Ray& ray) const override;
  std::vector<LayoutPatch> patches() const override;

 private:
  Cube(const Arrangement& plan, RaymapSize size, int pad);
  static Result<std::unique_ptr<RaymapLayout>> make(const Arrangement& plan, RaymapSize size, std::int64_t pad);

  double on_face(double u) const;
  Ray ray_in(std::size_t cell, double x, double y) const;

  const Arrangement& plan_;
  int square_;  ///< side of a face with its padding, px
  int pad_;
};

}  // namespace nodal::geometry
