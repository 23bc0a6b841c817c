#include "stitch/geometry/raymap/polyhedron.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "protocol/base/angles.h"

namespace nodal::geometry {
namespace {

/// How far a face's plane is used beyond its edges, as a part of the face's height.
constexpr double kBeyond = 0.25;

/// Twice the area of the triangle a, b, c.
double cross(const Pixel& a, const Pixel& b, const Pixel& c) {
  return (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x);
}

/// Cuts a convex polygon at a line parallel to an axis: what is below `limit` times `sign` stays.
std::vector<Pixel> cut(const std::vector<Pixel>& polygon, double Pixel::*axis, double sign, double limit) {
  std::vector<Pixel> kept;
  for (std::size_t k = 0; k < polygon.size(); ++k) {
    const Pixel &a = polygon[k], &b = polygon[(k + 1) % polygon.size()];
    const double da = sign * (limit - a.*axis), db = sign * (limit - b.*axis);
    if (da >= 0) kept.push_back(a);
    if ((da > 0 && db < 0) || (da < 0 && db > 0)) {
      const double t = da / (da - db);
      Pixel at{a.x + t * (b.x - a.x), a.y + t * (b.y - a.y)};
      at.*axis = limit;
      kept.push_back(at);
    }
  }
  return kept;
}

/// The solid angle of a triangle. The differences keep it exact for small ones.
double solid_angle_of(const Eigen::Vector3d& a, const Eigen::Vector3d& b, const Eigen::Vector3d& c) {
  const double la = a.norm(), lb = b.norm(), lc = c.norm();
  const double volume = a.dot((b - a).cross(c - a));
  return 2 * std::atan2(std::abs(volume), la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb);
}

}  // namespace

Polyhedron::Polyhedron(std::string_view name, RaymapSize size, const std::vector<Triangle>& triangles,
                       const FaceScale* scale)
    : RaymapLayout(size.width, size.height), name_(name), scale_(scale) {
  for (const Triangle& triangle : triangles) {
    Face face;
    for (int k = 0; k < 3; ++k) {
      const Corner& corner = triangle[static_cast<std::size_t>(k)];
      const Pixel at{corner.at.x * size.width, corner.at.y * size.height};
      face.corners[static_cast<std::size_t>(k)] = at;
      face.picture.col(k) = Eigen::Vector3d(at.x, at.y, 1);
      face.space.col(k) = corner.point;
    }
    const auto [left, right] = std::minmax({face.corners[0].x, face.corners[1].x, face.corners[2].x});
    const auto [top, bottom] = std::minmax({face.corners[0].y, face.corners[1].y, face.corners[2].y});
    face.left = left, face.right = right, face.top = top, face.bottom = bottom;
    face.face_of_space = face.space.inverse();
    face.map_of_picture = face.picture.inverse();
    // n . corner = 1 for all corners.
    face.normal = face.space.transpose().inverse() * Eigen::Vector3d::Ones();
    faces_.push_back(face);
  }
}

/// The point at a place of the picture, px: on a face, or on its plane not far beyond.
Eigen::Vector3d Polyhedron::point_of(const Face& face, const Pixel& at) const {
  Eigen::Vector3d map = face.map_of_picture * Eigen::Vector3d(at.x, at.y, 1);
  if (map.minCoeff() < -kBeyond) map = map.cwiseMax(-kBeyond), map /= map.sum();
  return face.space * (scale_ ? scale_->from_map(map) : map);
}

std::optional<Ray> Polyhedron::ray(double x, double y) const {
  if (!(x >= 0 && x <= width() && y >= 0 && y <= height())) return std::nullopt;
  // The face in which the point lies deepest; rounding may leave a point of an edge just outside of all.
  const Face* best = nullptr;
  double deepest = -1e300;
  for (const Face& face : faces_) {
    if (x < face.left - 1 || x > face.right + 1 || y < face.top - 1 || y > face.bottom + 1) continue;
    const auto& c = face.corners;
    const double area = cross(c[0], c[1], c[2]);
    const Pixel at{x, y};
    const double depth =
        std::min({cross(c[0], c[1], at) / area, cross(c[1], c[2], at) / area, cross(c[2], c[0], at) / area});
    if (depth > deepest) deepest = depth, best = &face;
    if (deepest > 1e-9) break;
  }
  // A pixel that an edge of the net crosses holds a ray, wherever its middle is.
  if (best == nullptr) return std::nullopt;
  if (deepest < -1e-9 &&
      solid_angle(std::min(static_cast<int>(x), width() - 1), std::min(static_cast<int>(y), height() - 1)) == 0) {
    return std::nullopt;
  }
  return Ray::towards(point_of(*best, {x, y}));
}

/// The solid angle of the part of a pixel that is in a face.
double Polyhedron::part(const Face& face, int i, int j) const {
  if (face.left >= i + 1 || face.right <= i || face.top >= j + 1 || face.bottom <= j) return 0;
  // The least and the most of the corners' barycentric coordinates: most pixels are whole in a face, or whole beside
  // it.
  const Eigen::Vector3d first = face.map_of_picture * Eigen::Vector3d(i, j, 1);
  const auto right = face.map_of_picture.col(0), down = face.map_of_picture.col(1);
  if (((first + right.cwiseMax(0) + down.cwiseMax(0)).array() < 0).any()) return 0;
  std::vector<Pixel> polygon;
  if (((first + right.cwiseMin(0) + down.cwiseMin(0)).array() >= 0).all()) {
    polygon = {{i + 0.0, j + 0.0}, {i + 1.0, j + 0.0}, {i + 1.0, j + 1.0}, {i + 0.0, j + 1.0}};
  } else {
    polygon.assign(face.corners.begin(), face.corners.end());
    polygon = cut(polygon, &Pixel::x, -1, i);
    polygon = cut(polygon, &Pixel::x, 1, i + 1);
    polygon = cut(polygon, &Pixel::y, -1, j);
    polygon = cut(polygon, &Pixel::y, 1, j + 1);
  }
  if (polygon.size() < 3) return 0;
  double sum = 0;
  const Eigen::Vector3d begin = point_of(face, polygon[0]);
  Eigen::Vector3d last = point_of(face, polygon[1]);
  for (std::size_t k = 2; k < polygon.size(); ++k) {
    const Eigen::Vector3d next = point_of(face, polygon[k]);
    sum += solid_angle_of(begin, last, next);
    last = next;
  }
  return sum;
}

double Polyhedron::solid_angle(int i, int j) const {
  double sum = 0;
  for (const Face& face : faces_) sum += part(face, i, j);
  return sum;
}

std::optional<Pixel> Polyhedron::pixel(const Ray& ray) const {
  // The faces through which the ray leaves the polyhedron: one, or two copies of which the picture holds a half each.
  double farthest = -1;
  for (const Face& face : faces_) farthest = std::max(farthest, face.normal.dot(ray.direction()));
  std::optional<Pixel> best;
  double deepest = -1e300;
  for (const Face& face : faces_) {
    if (face.normal.dot(ray.direction()) < farthest - 1e-12) continue;
    const Eigen::Vector3d on_face = face.face_of_space * (ray.direction() / farthest);
    const Eigen::Vector3d at = face.picture * (scale_ ? scale_->to_map(on_face) : on_face);
    const Pixel pixel{at.x(), at.y()};
    const double depth = std::min({pixel.x, width() - pixel.x, pixel.y, height() - pixel.y});
    if (depth > deepest)
      deepest = depth, best = Pixel{std::clamp<double>(pixel.x, 0, width()), std::clamp<double>(pixel.y, 0, height())};
  }
  return best;
}

std::vector<LayoutPatch> Polyhedron::patches() const {
  std::vector<LayoutPatch> patches;
  // Faces of which the picture holds a half at each end are cut in the middle of a side.
  const int across = std::ranges::any_of(faces_, [](const Face& face) { return face.left < 0; }) ? 2 : 1;
  for (std::size_t k = 0; k < faces_.size(); ++k) {
    // The first of two copies of a face; the picture holds a half of the face in each.
    const auto copy = [&](const Face& face) { return (face.normal - faces_[k].normal).norm() < 1e-9; };
    if (std::any_of(faces_.begin(), faces_.begin() + static_cast<std::ptrdiff_t>(k), copy)) continue;
    patches.push_back(
        {.triangle = true, .across = across, .point = [this, k](double u, double v) {
           const Face& face = faces_[k];
           const Eigen::Vector3d map(1 - u - v, u, v);
           const Eigen::Vector3d at = face.picture * map;
           return PatchPoint{{at.x(), at.y()}, Ray::towards(face.space * (scale_ ? scale_->from_map(map) : map))};
         }});
  }
  return patches;
}

Result<std::unique_ptr<RaymapLayout>> make_octahedron(RaymapSize size, std::int64_t) {
  if (size.width != size.height || size.width % 2 != 0) {
    const int side = std::clamp((size.width + 1) / 2 * 2, 2, kMaxRaymapSide);
    return fail(Errc::kBadValue,
                fmt::format("an octahedron raymap is a square with even sides, and {}x{} is not; {}x{} would be",
                            size.width, size.height, side, side));
  }
  std::vector<Polyhedron::Triangle> triangles;
  for (const int x : {-1, 1}) {
    for (const int y : {-1, 1}) {
      const Polyhedron::Corner side{{0.5 + 0.5 * x, 0.5}, {x * 1.0, 0, 0}}, end{{0.5, 0.5 + 0.5 * y}, {0, y * 1.0, 0}};
      triangles.push_back({Polyhedron::Corner{{0.5, 0.5}, {0, 0, 1}}, side, end});
      triangles.push_back({Polyhedron::Corner{{0.5 + 0.5 * x, 0.5 + 0.5 * y}, {0, 0, -1}}, side, end});
    }
  }
  return std::make_unique<Polyhedron>("octahedron", size, triangles);
}

Result<std::unique_ptr<RaymapLayout>> make_tetrahedron(RaymapSize size, std::int64_t) {
  // Around the strip the four corners follow each other, so that the fourth is the first again.
  const std::array<Eigen::Vector3d, 4> corners{{{-1, -1, -1}, {-1, 1, 1}, {1, -1, 1}, {1, 1, -1}}};
  const auto at = [&](int k) {
    return Polyhedron::Corner{{(k - 1) / 4.0, k % 2 == 0 ? 0.0 : 1.0}, corners[static_cast<std::size_t>(k % 4)]};
  };
  std::vector<Polyhedron::Triangle> triangles;
  for (int k = 0; k < 5; ++k) triangles.push_back({at(k), at(k + 1), at(k + 2)});
  return std::make_unique<Polyhedron>("tetrahedron", size, triangles);
}

Result<std::unique_ptr<RaymapLayout>> make_icosahedron(RaymapSize size, std::int64_t) {
  const double latitude = std::atan(0.5);
  const auto on_ring = [&](double k, double phi) { return Ray::at(Angles{(k - 2) * 2 * kPi / 5, phi}).direction(); };
  const Eigen::Vector3d north(0, -1, 0), south(0, 1, 0);
  // The k-th corner of the upper and lower ring.
  const auto upper = [&](int k) { return on_ring(k, -latitude); };
  const auto lower = [&](int k) { return on_ring(k + 0.5, latitude); };
  const auto at = [](double x, int row, const Eigen::Vector3d& point) {
    return Polyhedron::Corner{{x / 5, row / 2.0}, point};
  };
  std::vector<Polyhedron::Triangle> triangles;
  for (int k = -1; k < 5; ++k) {
    triangles.push_back({at(k + 0.5, 0, upper(k)), at(k + 1.5, 0, upper(k + 1)), at(k + 1, 1, lower(k))});
    triangles.push_back({at(k + 0.5, 1, lower(k)), at(k + 1.5, 1, lower(k + 1)), at(k + 1, 2, south)});
    if (k < 0) continue;
    triangles.push_back({at(k, 1, lower(k - 1)), at(k + 1, 1, lower(k)), at(k + 0.5, 0, upper(k))});
    triangles.push_back({at(k, 2, upper(k)), at(k + 1, 2, upper(k + 1)), at(k + 0.5, 1, north)});
  }
  return std::make_unique<Polyhedron>("icosahedron", size, triangles);
}

}  // namespace nodal::geometry
