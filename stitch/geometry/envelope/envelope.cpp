#include "stitch/geometry/envelope/envelope.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <cmath>
#include <string>
#include <utility>

#include "protocol/base/try.h"
#include "stitch/geometry/envelope/obj.h"

namespace nodal::geometry {
namespace {

using Eigen::Vector3d;

constexpr double kOnSurface = 1e-12;  // tolerance relative to the distance
constexpr double kInPlane = 1e-9;     // tolerance relative to the mesh's size

double volume(const Vector3d& a, const Vector3d& b, const Vector3d& c) { return a.dot(b.cross(c)); }

/// The solid angle of a triangle (Van Oosterom and Strackee 1983).
double solid_angle_of(const TriangleTree::Triangle& t) {
  const double a = t[0].norm(), b = t[1].norm(), c = t[2].norm();
  return 2 *
         std::atan2(volume(t[0], t[1], t[2]), a * b * c + t[0].dot(t[1]) * c + t[1].dot(t[2]) * a + t[2].dot(t[0]) * b);
}

}  // namespace

Result<Envelope> Envelope::named(std::string_view text) {
  NODAL_TRY_ASSIGN(Solid solid, Solid::named(text));
  Envelope envelope;
  envelope.solid_.emplace(std::move(solid));
  return envelope;
}

Result<Envelope> Envelope::from_obj(std::string_view text) {
  NODAL_TRY_ASSIGN(const ObjMesh mesh, read_obj(text, kMaxObjBytes, kMaxTriangles));
  return from_mesh(mesh);
}

Result<Envelope> Envelope::from_mesh(const ObjMesh& mesh) {
  if (mesh.triangles.size() > kMaxTriangles)
    return fail(Errc::kTooLarge, fmt::format("more than {} triangles: simplify the mesh", kMaxTriangles));
  NODAL_TRY(check_closed(mesh));
  const auto corner = [&](const ObjMesh::Triangle& triangle, std::size_t k) {
    return mesh.vertices[triangle.corners[k].vertex];
  };
  double inside = 0;
  for (const ObjMesh::Triangle& triangle : mesh.triangles)
    inside += volume(corner(triangle, 0), corner(triangle, 1), corner(triangle, 2));
  Envelope envelope;
  envelope.counted_ = mesh.counted;
  double seen = 0;
  std::vector<TriangleTree::Triangle> triangles;
  for (const ObjMesh::Triangle& triangle : mesh.triangles) {
    triangles.push_back(
        {corner(triangle, inside < 0 ? 2 : 0), corner(triangle, 1), corner(triangle, inside < 0 ? 0 : 2)});
    seen += solid_angle_of(triangles.back());
    envelope.lines_.push_back(triangle.line);
  }
  envelope.mesh_ = TriangleTree(std::move(triangles));
  NODAL_TRY(envelope.check_eye(Vector3d::Zero()));
  if (std::abs(seen - 4 * std::acos(-1.0)) > 1e-6)
    return fail(Errc::kBadValue, "the mesh goes around the nodal point more than once");
  return envelope;
}

Status Envelope::check_eye(const Vector3d& eye) const {
  if (solid_) {
    if (std::abs(solid_->outside(eye)) > kOnSurface * std::max(1.0, eye.norm())) return {};
    return fail(Errc::kBadValue, "the eye is on the surface of the envelope: move it inside or outside");
  }
  // The nodal point is checked before anything can be said about what is outside.
  if (!eye.isZero(0) && eye.norm() > rho(Ray::towards(eye)) * (1 + kOnSurface)) return {};
  for (std::size_t k = 0; k < lines_.size(); ++k) {
    const auto& [a, b, c] = mesh_.triangles()[k];
    const double depth = volume(a - eye, b - eye, c - eye);
    if (depth > kInPlane * mesh_.reach() * (b - a).cross(c - a).norm()) continue;
    return fail(Errc::kBadValue,
                fmt::format("{} does not see the inner side of the face of {} {}: it is outside of the mesh's kernel",
                            eye.isZero(0) ? "the nodal point (0, 0, 0)" : "the eye", counted_, lines_[k]));
  }
  return {};
}

std::optional<double> Envelope::first_hit(const Vector3d& from, const Vector3d& direction) const {
  if (solid_) return solid_->first_hit(from, direction);
  const std::optional<TriangleTree::Hit> hit = mesh_.first_hit(from, direction);
  return hit ? std::optional(hit->at) : std::nullopt;
}

std::optional<Vector3d> Envelope::seen(const Vector3d& eye, const Ray& direction) const {
  const std::optional<double> at = first_hit(eye, direction.direction());
  return at ? std::optional<Vector3d>(eye + *at * direction.direction()) : std::nullopt;
}

double Envelope::rho(const Ray& ray) const { return first_hit(Vector3d::Zero(), ray.direction()).value(); }

}  // namespace nodal::geometry
