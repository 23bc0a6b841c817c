#include "stitch/geometry/raymap/cube.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

namespace nodal::geometry {
namespace {

/// A face looks along `forward`; its columns run along `right`, its rows along `down`.
struct Face {
  std::array<int, 3> forward, right, down;
};

enum : int { kRight, kLeft, kUp, kDown, kFront, kBack };

/// In the order of the names above.
constexpr std::array<Face, 6> kFaces{{
    {{1, 0, 0}, {0, 0, -1}, {0, 1, 0}},
    {{-1, 0, 0}, {0, 0, 1}, {0, 1, 0}},
    {{0, -1, 0}, {1, 0, 0}, {0, 0, 1}},
    {{0, 1, 0}, {1, 0, 0}, {0, 0, -1}},
    {{0, 0, 1}, {1, 0, 0}, {0, 1, 0}},
    {{0, 0, -1}, {-1, 0, 0}, {0, 1, 0}},
}};

constexpr Cube::Arrangement k3x2{"cube", 3, 2, {{{kRight}, {kLeft}, {kUp}, {kDown}, {kFront}, {kBack}}}};
constexpr Cube::Arrangement k6x1{"cube_6x1", 6, 1, {{{kRight}, {kLeft}, {kUp}, {kDown}, {kFront}, {kBack}}}};
constexpr Cube::Arrangement kCross{
    "cube_cross", 4, 3, {{{}, {kUp}, {}, {}, {kLeft}, {kFront}, {kRight}, {kBack}, {}, {kDown}, {}, {}}}};
constexpr Cube::Arrangement kEquiangular{
    "equiangular_cube", 3, 2, {{{kLeft}, {kFront}, {kRight}, {kDown, 3}, {kBack, 1}, {kUp, 3}}}, true};

double along(const std::array<int, 3>& axis, const Ray& ray) {
  return axis[0] * ray.x() + axis[1] * ray.y() + axis[2] * ray.z();
}

/// The solid angle of the rectangle from the face's centre to (x, y).
double corner(double x, double y) { return std::atan(x * y / std::sqrt(1 + x * x + y * y)); }

/// Turns a point of the picture by quarter turns anticlockwise (rows grow downwards).
Pixel turned(Pixel at, int quarters) {
  for (int k = 0; k < quarters; ++k) at = {at.y, -at.x};
  return at;
}

}  // namespace

Cube::Cube(const Arrangement& plan, RaymapSize size, int pad)
    : RaymapLayout(size.width, size.height), plan_(plan), square_(size.width / plan.columns), pad_(pad) {}

Result<std::unique_ptr<RaymapLayout>> Cube::make(const Arrangement& plan, RaymapSize size, std::int64_t pad) {
  const int least = static_cast<int>(2 * pad) + 1;
  const int side = size.width / plan.columns;
  const bool squares = side * plan.columns == size.width && side * plan.rows == size.height;
  if (!squares || side < least) {
    const int near = std::clamp((size.width + plan.columns / 2) / plan.columns, least, kMaxRaymapSide / plan.columns);
    const auto text = [](int width, int height) { return fmt::format("{}x{}", width, height); };
    const std::string article = plan.name.starts_with('e') ? "an " : "a ";
    return fail(Errc::kBadValue,
                fmt::format("{}{} raymap is {} by {} square faces{}, and {} is not; {} would be", article, plan.name,
                            plan.columns, plan.rows,
                            pad > 0 ? fmt::format(" with {}{} around each", pad, pad > 1 ? " pixels" : " pixel") : "",
                            text(size.width, size.height), text(plan.columns * near, plan.rows * near)));
  }
  return std::unique_ptr<RaymapLayout>(new Cube(plan, size, static_cast<int>(pad)));
}

Result<std::unique_ptr<RaymapLayout>> Cube::make_3x2(RaymapSize size, std::int64_t pad) {
  return make(k3x2, size, pad);
}
Result<std::unique_ptr<RaymapLayout>> Cube::make_6x1(RaymapSize size, std::int64_t pad) {
  return make(k6x1, size, pad);
}
Result<std::unique_ptr<RaymapLayout>> Cube::make_cross(RaymapSize size, std::int64_t pad) {
  return make(kCross, size, pad);
}
Result<std::unique_ptr<RaymapLayout>> Cube::make_equiangular(RaymapSize size, std::int64_t pad) {
  return make(kEquiangular, size, pad);
}

/// From the place on a face, -1..1 without the padding, to the plane at distance 1.
double Cube::on_face(double u) const { return plan_.equiangular ? std::tan(std::numbers::pi / 4 * u) : u; }

std::optional<Ray> Cube::ray(double x, double y) const {
  if (!(x >= 0 && x <= width() && y >= 0 && y <= height())) return std::nullopt;
  const int column = std::min(static_cast<int>(x) / square_, plan_.columns - 1);
  const int row = std::min(static_cast<int>(y) / square_, plan_.rows - 1);
  const auto cell = static_cast<std::size_t>(plan_.columns * row + column);
  if (plan_.places[cell].face < 0) return std::nullopt;
  const double side = square_ - 2 * pad_;
  return ray_in(cell, 2 * (x - column * square_ - pad_) / side - 1, 2 * (y - row * square_ - pad_) / side - 1);
}

/// The ray at a place in a square of the picture: -1..1 without the padding.
Ray Cube::ray_in(std::size_t cell, double x, double y) const {
  const Place& place = plan_.places[cell];
  const Pixel at = turned({x, y}, place.turned);
  const double a = on_face(at.x), b = on_face(at.y);
  const Face& face = kFaces[static_cast<std::size_t>(place.face)];
  const auto component = [&](std::size_t k) { return face.forward[k] + a * face.right[k] + b * face.down[k]; };
  return Ray::towards(component(0), component(1), component(2));
}

double Cube::solid_angle(int i, int j) const {
  const auto cell = static_cast<std::size_t>(plan_.columns * (j / square_) + i / square_);
  if (plan_.places[cell].face < 0) return 0;
  const double side = square_ - 2 * pad_;
  const auto edge = [&](int k) { return on_face(std::clamp(2 * (k - pad_) / side - 1, -1.0, 1.0)); };
  const double x0 = edge(i % square_), x1 = edge(i % square_ + 1);
  const double y0 = edge(j % square_), y1 = edge(j % square_ + 1);
  return std::max(0.0, corner(x1, y1) - corner(x0, y1) - corner(x1, y0) + corner(x0, y0));
}

std::vector<LayoutPatch> Cube::patches() const {
  std::vector<LayoutPatch> patches;
  for (std::size_t cell = 0; cell < plan_.places.size(); ++cell) {
    const int column = static_cast<int>(cell) % plan_.columns, row = static_cast<int>(cell) / plan_.columns;
    if (row >= plan_.rows || plan_.places[cell].face < 0) continue;
    patches.push_back({.point = [this, cell, column, row](double u, double v) {
      const double side = square_ - 2 * pad_;
      return PatchPoint{{column * square_ + pad_ + u * side, row * square_ + pad_ + v * side},
                        ray_in(cell, 2 * u - 1, 2 * v - 1)};
    }});
  }
  return patches;
}

std::optional<Pixel> Cube::pixel(const Ray& ray) const {
  int best = 0;
  const auto forward_of = [&](int f) { return along(kFaces[static_cast<std::size_t>(f)].forward, ray); };
  for (int f = 1; f < 6; ++f) {
    if (forward_of(f) > forward_of(best)) best = f;
  }
  const Face& face = kFaces[static_cast<std::size_t>(best)];
  const auto to_place = [&](const std::array<int, 3>& axis) {
    const double a = along(axis, ray) / forward_of(best);
    return plan_.equiangular ? std::atan(a) * 4 / std::numbers::pi : a;
  };
  const auto* found = std::ranges::find(plan_.places, best, &Place::face);
  const Pixel at = turned({to_place(face.right), to_place(face.down)}, (4 - found->turned) % 4);
  const auto cell = static_cast<int>(found - plan_.places.begin());
  const double half = square_ / 2.0 - pad_;
  return Pixel{(cell % plan_.columns + 0.5) * square_ + at.x * half,
               (cell / plan_.columns + 0.5) * square_ + at.y * half};
}

}  // namespace nodal::geometry
