#include "stitch/geometry/raymap/cube.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace nodal::geometry {
namespace {

/// A face looks along `forward`; its columns run along `right`, its rows along `down`.
struct Face {
  std::array<int, 3> forward, right, down;
};

/// In the order of the picture: right left up / down front back.
constexpr std::array<Face, 6> kFaces{{
    {{1, 0, 0}, {0, 0, -1}, {0, 1, 0}},
    {{-1, 0, 0}, {0, 0, 1}, {0, 1, 0}},
    {{0, -1, 0}, {1, 0, 0}, {0, 0, 1}},
    {{0, 1, 0}, {1, 0, 0}, {0, 0, -1}},
    {{0, 0, 1}, {1, 0, 0}, {0, 1, 0}},
    {{0, 0, -1}, {-1, 0, 0}, {0, 1, 0}},
}};

double along(const std::array<int, 3>& axis, const Ray& ray) {
  return axis[0] * ray.x() + axis[1] * ray.y() + axis[2] * ray.z();
}

/// The solid angle of the rectangle from the face's centre to (x, y).
double corner(double x, double y) { return std::atan(x * y / std::sqrt(1 + x * x + y * y)); }

}  // namespace

Result<std::unique_ptr<RaymapLayout>> Cube::make(int width, int height) {
  const int side = std::clamp((width + 1) / 3, 1, kMaxRaymapSide / 3);
  if (width % 3 != 0 || height % 2 != 0 || width / 3 != height / 2) {
    return fail(Errc::kBadValue, "a cube raymap is three by two square faces, and " + std::to_string(width) + "x" +
                                     std::to_string(height) + " is not; " + std::to_string(3 * side) + "x" +
                                     std::to_string(2 * side) + " would be");
  }
  return std::unique_ptr<RaymapLayout>(new Cube(width, height));
}

std::optional<Ray> Cube::ray(double x, double y) const {
  if (!(x >= 0 && x <= width() && y >= 0 && y <= height())) return std::nullopt;
  const int side = face_side();
  const int column = std::min(static_cast<int>(x) / side, 2);
  const int row = std::min(static_cast<int>(y) / side, 1);
  const double a = 2 * (x - column * side) / side - 1;
  const double b = 2 * (y - row * side) / side - 1;
  const Face& face = kFaces[static_cast<std::size_t>(3 * row + column)];
  const auto component = [&](std::size_t k) { return face.forward[k] + a * face.right[k] + b * face.down[k]; };
  return Ray::towards(component(0), component(1), component(2));
}

double Cube::solid_angle(int i, int j) const {
  const int side = face_side();
  const double x0 = 2.0 * (i % side) / side - 1, x1 = 2.0 * (i % side + 1) / side - 1;
  const double y0 = 2.0 * (j % side) / side - 1, y1 = 2.0 * (j % side + 1) / side - 1;
  return corner(x1, y1) - corner(x0, y1) - corner(x1, y0) + corner(x0, y0);
}

std::optional<Pixel> Cube::pixel(const Ray& ray) const {
  std::size_t best = 0;
  for (std::size_t f = 1; f < kFaces.size(); ++f) {
    if (along(kFaces[f].forward, ray) > along(kFaces[best].forward, ray)) best = f;
  }
  const Face& face = kFaces[best];
  const double forward = along(face.forward, ray);
  const double side = face_side();
  return Pixel{(static_cast<double>(best % 3) + 0.5 * (along(face.right, ray) / forward + 1)) * side,
               (static_cast<double>(best / 3) + 0.5 * (along(face.down, ray) / forward + 1)) * side};
}

}  // namespace nodal::geometry
