#include "stitch/mesh/of_layout.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <optional>
#include <tuple>

#include "stitch/geometry/raymap/scattered_rays.h"
#include "stitch/mesh/delaunay.h"

namespace nodal::mesh {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;
using geometry::LayoutPatch;
using geometry::PatchPoint;
using geometry::Ray;

constexpr double kSame = 1e-8;  // between directions
/// Share of the allowed error that is used at the points where it is measured; between them it is a little larger.
constexpr double kMeasured = 0.9;

/// A corner before it is welded.
struct Corner {
  Vector3d direction;
  Vector2d texture;
};

class Builder {
 public:
  Builder(const geometry::RaymapLayout& layout, const geometry::Envelope& envelope)
      : layout_(layout), envelope_(envelope), welder_(directions_, kSame) {}

  void add(const LayoutPatch& patch, int n) {
    const int columns = patch.across * n;
    const int rows = patch.triangle ? columns : patch.down > 0 ? patch.down * n : 1;
    const auto at = [&](int i, int j) {
      const PatchPoint point = patch.point(static_cast<double>(i) / columns, static_cast<double>(j) / rows);
      return Corner{point.ray.direction(), {point.at.x / layout_.width(), point.at.y / layout_.height()}};
    };
    for (int j = 0; j < rows; ++j) {
      for (int i = 0; i < (patch.triangle ? columns - j : columns); ++i) {
        if (!patch.triangle) {
          quad(at(i, j), at(i + 1, j), at(i, j + 1), at(i + 1, j + 1));
          continue;
        }
        triangle(at(i, j), at(i + 1, j), at(i, j + 1));
        if (i + 1 < columns - j) triangle(at(i + 1, j), at(i + 1, j + 1), at(i, j + 1));
      }
    }
  }

  std::uint32_t vertex(const Corner& corner) {
    const std::uint32_t point = welder_.add(corner.direction);
    if (point == mesh_.points.size())
      mesh_.points.push_back(envelope_.rho(Ray::towards(corner.direction)) * corner.direction);
    const auto rounded = [](double texture) { return std::llround(texture * 1e9); };
    const auto key = std::tuple(point, rounded(corner.texture.x()), rounded(corner.texture.y()));
    const auto [found, fresh] = known_.emplace(key, static_cast<std::uint32_t>(mesh_.vertices.size()));
    if (fresh) mesh_.vertices.push_back({point, corner.texture});
    return found->second;
  }

  Raymesh& mesh() { return mesh_; }

 private:
  static bool same(const Corner& a, const Corner& b) { return (a.direction - b.direction).norm() < 2 * kSame; }

  /// Corners in the order of rows. A side that is one point, as at a pole, becomes a corner in the middle of it.
  void quad(const Corner& a, const Corner& b, const Corner& c, const Corner& d) {
    const auto middle = [](const Corner& p, const Corner& q) {
      return Corner{p.direction, 0.5 * (p.texture + q.texture)};
    };
    if (same(a, b)) return triangle(middle(a, b), d, c);
    if (same(c, d)) return triangle(a, b, middle(c, d));
    if ((a.direction - d.direction).norm() < (b.direction - c.direction).norm()) {
      triangle(a, b, d);
      triangle(a, d, c);
    } else {
      triangle(a, b, c);
      triangle(b, d, c);
    }
  }

  /// Cut where it crosses the left edge of the raymap; what is left of it goes on at the right edge.
  void triangle(const Corner& a, const Corner& b, const Corner& c) {
    constexpr double kBeside = 1e-9;
    std::array<Corner, 3> corners{a, b, c};
    for (std::size_t k = 0; k < 3; ++k) {
      const Corner &p = corners[k], &q = corners[(k + 1) % 3], &other = corners[(k + 2) % 3];
      const double from = p.texture.x(), to = q.texture.x();
      if (std::min(from, to) > -kBeside || std::max(from, to) < kBeside) continue;
      // On the straight edge between the envelope's points.
      const Vector3d start = rho(p) * p.direction, end = rho(q) * q.direction;
      const double t = from / (from - to);
      Corner cut{(start + t * (end - start)).normalized(), p.texture + t * (q.texture - p.texture)};
      cut.texture.x() = 0;
      triangle(p, cut, other);
      return triangle(cut, q, other);
    }
    if (std::ranges::any_of(corners, [&](const Corner& corner) { return corner.texture.x() < -kBeside; })) {
      for (Corner& corner : corners) corner.texture.x() += 1;
    }
    const double inward = a.direction.dot(b.direction.cross(c.direction));
    if (inward == 0) return;
    mesh_.triangles.push_back(
        {vertex(corners[0]), vertex(corners[inward < 0 ? 1 : 2]), vertex(corners[inward < 0 ? 2 : 1])});
  }
  double rho(const Corner& corner) const { return envelope_.rho(Ray::towards(corner.direction)); }

  const geometry::RaymapLayout& layout_;
  const geometry::Envelope& envelope_;
  std::vector<Vector3d> directions_;
  Welder welder_;
  std::map<std::tuple<std::uint32_t, long long, long long>, std::uint32_t> known_;
  Raymesh mesh_;
};

/// The error of one triangle, at its corners, on its sides and inside.
double error_of(const Raymesh& mesh, const Raymesh::Triangle& t, const geometry::RaymapLayout& layout) {
  constexpr int kSteps = 6;
  double most = 0;
  for (int i = 0; i <= kSteps; ++i) {
    for (int j = 0; i + j <= kSteps; ++j) {
      // A little inside, so that the place is not in the patch beside.
      Vector3d weights(i, j, kSteps - i - j);
      weights = (weights / kSteps).array() * (1 - 1e-6) + 1e-6 / 3;
      Vector2d texture = Vector2d::Zero();
      Vector3d point = Vector3d::Zero();
      for (int k = 0; k < 3; ++k) {
        texture += weights[k] * mesh.vertices[t[static_cast<std::size_t>(k)]].texture;
        point += weights[k] * mesh.point(t[static_cast<std::size_t>(k)]);
      }
      const std::optional<Ray> ray = layout.ray(texture.x() * layout.width(), texture.y() * layout.height());
      most = std::max(most, ray ? geometry::angle_between(*ray, Ray::towards(point)) : std::acos(-1.0));
    }
  }
  return most;
}

std::size_t triangles_at(const std::vector<LayoutPatch>& patches, int n) {
  std::size_t count = 0;
  const auto side = static_cast<std::size_t>(n);
  for (const LayoutPatch& patch : patches) {
    const auto across = static_cast<std::size_t>(patch.across) * side;
    count += patch.triangle ? across * across
                            : 2 * across * (patch.down > 0 ? static_cast<std::size_t>(patch.down) * side : 1);
  }
  return count;
}

Result<LayoutMesh> of_scattered(const geometry::RaymapLayout& layout, const geometry::Envelope& envelope) {
  const auto* rays = dynamic_cast<const geometry::ScatteredRays*>(&layout);
  const std::size_t count = static_cast<std::size_t>(layout.width()) * static_cast<std::size_t>(layout.height());
  if (rays == nullptr) return fail(Errc::kUnsupported, "there is no mesh of the layout " + std::string(layout.name()));
  if (2 * count > kMaxMeshTriangles) {
    return fail(Errc::kTooLarge,
                fmt::format("a mesh of {} rays has twice as many triangles; at most {} are made: give a smaller size",
                            count, kMaxMeshTriangles));
  }
  LayoutMesh made;
  for (int j = 0; j < layout.height(); ++j) {
    for (int i = 0; i < layout.width(); ++i) {
      const Ray ray = layout.ray(i + 0.5, j + 0.5).value();
      made.mesh.vertices.push_back({static_cast<std::uint32_t>(made.mesh.points.size()),
                                    {(i + 0.5) / layout.width(), (j + 0.5) / layout.height()}});
      made.mesh.points.push_back(envelope.rho(ray) * ray.direction());
    }
  }
  made.mesh.triangles = delaunay(*rays);
  return made;
}

}  // namespace

Result<LayoutMesh> mesh_of_layout(const geometry::RaymapLayout& layout, const geometry::Envelope& envelope,
                                  double most_error) {
  const std::vector<LayoutPatch> patches = layout.patches();
  if (patches.empty()) return of_scattered(layout, envelope);
  for (int n = 1;;) {
    if (triangles_at(patches, n) > kMaxMeshTriangles) {
      return fail(Errc::kTooLarge,
                  fmt::format("a mesh with this error would have more than {} triangles: allow a larger error",
                              kMaxMeshTriangles));
    }
    Builder builder(layout, envelope);
    for (const LayoutPatch& patch : patches) builder.add(patch, n);
    double error = 0;
    for (const Raymesh::Triangle& triangle : builder.mesh().triangles)
      error = std::max(error, error_of(builder.mesh(), triangle, layout));
    if (error <= kMeasured * most_error) return LayoutMesh{std::move(builder.mesh()), error};
    // The error of a smooth layout falls with the square of n; near a kink more slowly.
    n = std::max(n + 1, static_cast<int>(n * std::min(4.0, 0.95 * std::sqrt(error / most_error))));
  }
}

}  // namespace nodal::mesh
