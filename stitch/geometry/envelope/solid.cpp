#include "stitch/geometry/envelope/solid.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <limits>
#include <utility>

#include "protocol/base/angles.h"
#include "stitch/geometry/ray.h"

namespace nodal::geometry {
namespace {

using Eigen::Vector3d;

/// The part of a line that is inside, as multiples of its direction; empty if first > last.
struct Interval {
  double first = -std::numeric_limits<double>::infinity();
  double last = std::numeric_limits<double>::infinity();
};

constexpr Interval kNowhere{1, 0};

/// Where a t^2 + b t + c <= 0, for a >= 0.
Interval not_positive(double a, double b, double c) {
  if (a == 0) {
    if (b == 0) return c <= 0 ? Interval{} : kNowhere;
    return b > 0 ? Interval{.last = -c / b} : Interval{.first = -c / b};
  }
  const double under = b * b - 4 * a * c;
  if (under < 0) return kNowhere;
  // The sum of two numbers of one sign: no digits are lost.
  const double sum = -0.5 * (b + std::copysign(std::sqrt(under), b));
  const double one = sum / a, other = sum != 0 ? c / sum : 0;
  return {std::min(one, other), std::max(one, other)};
}

using Sizes = std::array<double, 2>;

std::vector<Quadric> half_spaces(const std::vector<Vector3d>& normals, double distance) {
  std::vector<Quadric> parts;
  for (const Vector3d& normal : normals) parts.push_back({Vector3d::Zero(), normal.normalized(), -distance});
  return parts;
}

/// The corners of a cube of side 2; of every second one, those of a tetrahedron.
std::vector<Vector3d> cube_corners(bool every_second) {
  std::vector<Vector3d> corners;
  for (const int x : {-1, 1}) {
    for (const int y : {-1, 1}) {
      for (const int z : {-1, 1}) {
        if (!every_second || x * y * z < 0) corners.emplace_back(x, y, z);
      }
    }
  }
  return corners;
}

std::vector<Vector3d> axes() {
  std::vector<Vector3d> ends;
  for (int k = 0; k < 3; ++k) ends.insert(ends.end(), {Vector3d::Unit(k), -Vector3d::Unit(k)});
  return ends;
}

/// Up, down and two rings of five: the corners of an icosahedron as the layout icosahedron has them, the centres of the
/// faces of a dodecahedron that stands on one.
std::vector<Vector3d> twelve() {
  std::vector<Vector3d> points{{0, -1, 0}, {0, 1, 0}};
  const double latitude = std::atan(0.5);
  for (int k = 0; k < 5; ++k) {
    points.push_back(Ray::at(Angles{k * 2 * kPi / 5, -latitude}).direction());
    points.push_back(Ray::at(Angles{(k + 0.5) * 2 * kPi / 5, latitude}).direction());
  }
  return points;
}

/// The centres of the icosahedron's faces: three corners, each pair 63.4 degrees apart.
std::vector<Vector3d> twenty() {
  std::vector<Vector3d> centres;
  const std::vector<Vector3d> points = twelve();
  const auto near = [](const Vector3d& a, const Vector3d& b) { return a.dot(b) > 0.4 && a.dot(b) < 0.5; };
  for (std::size_t a = 0; a < points.size(); ++a) {
    for (std::size_t b = a + 1; b < points.size(); ++b) {
      for (std::size_t c = b + 1; c < points.size(); ++c) {
        if (near(points[a], points[b]) && near(points[b], points[c]) && near(points[c], points[a]))
          centres.push_back(points[a] + points[b] + points[c]);
      }
    }
  }
  return centres;
}

/// The inscribed sphere's radius, for corners at 1: the same for the dodecahedron and the icosahedron.
const double kInradius = std::sqrt((5 + 2 * std::sqrt(5.0)) / 15);

std::vector<Quadric> sphere(const Sizes& r) { return {{Vector3d::Constant(1 / r[0]), Vector3d::Zero(), -r[0]}}; }
std::vector<Quadric> cylinder(const Sizes& size) {
  return {{{1 / size[0], 0, 1 / size[0]}, Vector3d::Zero(), -size[0]},
          {Vector3d::Zero(), Vector3d::UnitY(), -size[1] / 2},
          {Vector3d::Zero(), -Vector3d::UnitY(), -size[1] / 2}};
}
/// |z| <= depth - (x^2 + y^2) / (4 depth): the focus of both is the nodal point.
std::vector<Quadric> paraboloid(const Sizes& depth) {
  const Vector3d across(0.25 / depth[0], 0.25 / depth[0], 0);
  return {{across, Vector3d::UnitZ(), -depth[0]}, {across, -Vector3d::UnitZ(), -depth[0]}};
}
std::vector<Quadric> cube(const Sizes& side) { return half_spaces(axes(), side[0] / 2); }
std::vector<Quadric> tetrahedron(const Sizes& r) {
  std::vector<Vector3d> normals;
  for (const Vector3d& corner : cube_corners(true)) normals.push_back(-corner);
  return half_spaces(normals, r[0] / 3);
}
std::vector<Quadric> octahedron(const Sizes& r) { return half_spaces(cube_corners(false), r[0] / std::sqrt(3.0)); }
std::vector<Quadric> dodecahedron(const Sizes& r) { return half_spaces(twelve(), kInradius * r[0]); }
std::vector<Quadric> icosahedron(const Sizes& r) { return half_spaces(twenty(), kInradius * r[0]); }

struct Shape {
  std::string_view name;
  std::string_view sizes;
  std::size_t count;
  std::vector<Quadric> (*parts)(const Sizes& sizes);
};

/// The radius of a polyhedron is that of its corners.
constexpr std::array kShapes{Shape{"sphere", "RADIUS", 1, &sphere},
                             Shape{"cylinder", "RADIUS,HEIGHT", 2, &cylinder},
                             Shape{"cube", "SIDE", 1, &cube},
                             Shape{"paraboloid", "DEPTH", 1, &paraboloid},
                             Shape{"tetrahedron", "RADIUS", 1, &tetrahedron},
                             Shape{"octahedron", "RADIUS", 1, &octahedron},
                             Shape{"dodecahedron", "RADIUS", 1, &dodecahedron},
                             Shape{"icosahedron", "RADIUS", 1, &icosahedron}};

}  // namespace

std::string Solid::names() {
  std::string text;
  for (const Shape& shape : kShapes)
    text += (text.empty() ? "" : " ") + std::string(shape.name) + ":" + std::string(shape.sizes);
  return text;
}

Result<Solid> Solid::named(std::string_view text) {
  const std::size_t colon = std::min(text.find(':'), text.size());
  const auto shape = std::ranges::find(kShapes, text.substr(0, colon), &Shape::name);
  if (shape == kShapes.end()) {
    return fail(Errc::kUnsupported, "no envelope is called '" + std::string(text.substr(0, std::min(colon, 64UL))) +
                                        "'; there are: " + names());
  }
  Sizes sizes{};
  const char *at = text.data() + std::min(colon + 1, text.size()), *end = text.data() + text.size();
  bool good = true;
  for (std::size_t k = 0; good && k < shape->count; ++k) {
    const auto [after, error] = std::from_chars(at, end, sizes[k]);
    const bool last = k + 1 == shape->count;
    good = error == std::errc() && (last ? after == end : after != end && *after == ',') && sizes[k] >= 1e-3 &&
           sizes[k] <= kLargestEnvelope;
    at = after + (last || after == end ? 0 : 1);
  }
  if (!good) {
    return fail(Errc::kBadValue, "'" + std::string(text.substr(0, 64)) + "': write " + std::string(shape->name) + ":" +
                                     std::string(shape->sizes) + ", metres, 0.001 to 1e6");
  }
  return Solid(shape->parts(sizes));
}

double Solid::outside(const Vector3d& point) const {
  double most = -std::numeric_limits<double>::infinity();
  for (const Quadric& part : parts_) most = std::max(most, part.at(point) / std::max(1.0, part.gradient(point).norm()));
  return most;
}

std::optional<double> Solid::first_hit(const Vector3d& from, const Vector3d& direction) const {
  Interval inside;
  for (const Quadric& part : parts_) {
    const Interval its =
        not_positive(part.q.dot(direction.cwiseProduct(direction)), part.gradient(from).dot(direction), part.at(from));
    inside = {std::max(inside.first, its.first), std::min(inside.last, its.last)};
  }
  if (inside.first > inside.last || inside.last <= 0) return std::nullopt;
  return inside.first > 0 ? inside.first : inside.last;
}

}  // namespace nodal::geometry
