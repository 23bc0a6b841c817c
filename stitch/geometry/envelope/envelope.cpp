#include "stitch/geometry/envelope/envelope.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <charconv>
#include <cmath>
#include <limits>
#include <map>
#include <optional>
#include <string>
#include <utility>

namespace nodal::geometry {
namespace {

using Eigen::Vector3d;

constexpr double kLargest = 1e6;  // m

double volume(const Vector3d& a, const Vector3d& b, const Vector3d& c) { return a.dot(b.cross(c)); }

std::string at_line(int line) { return "line " + std::to_string(line) + ": "; }

/// The words of a line.
class Words {
 public:
  explicit Words(std::string_view line) : rest_(line) {}
  std::string_view next() {
    const std::size_t from = std::min(rest_.find_first_not_of(" \t\r"), rest_.size());
    const std::size_t end = std::min(rest_.find_first_of(" \t\r", from), rest_.size());
    const std::string_view word = rest_.substr(from, end - from);
    rest_.remove_prefix(end);
    return word;
  }

 private:
  std::string_view rest_;
};

template <class Number>
std::optional<Number> number(std::string_view word) {
  Number value{};
  const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), value);
  return error == std::errc() && end == word.data() + word.size() && !word.empty() ? std::optional(value)
                                                                                   : std::nullopt;
}

struct Face {
  std::array<std::size_t, 3> corners;
  int line;
};

struct Mesh {
  std::vector<Vector3d> vertices;
  std::vector<Face> faces;
};

Result<Vector3d> read_vertex(Words words, int line) {
  Vector3d vertex;
  for (double& coordinate : vertex) {
    const std::optional<double> value = number<double>(words.next());
    if (!value || !(std::abs(*value) <= kLargest)) {
      return fail(Errc::kBadFormat, at_line(line) + "after v there must be three numbers, metres, up to 1e6");
    }
    coordinate = *value;
  }
  return vertex;
}

Status read_face(Words words, int line, Mesh& mesh) {
  std::vector<std::size_t> corners;
  for (std::string_view word = words.next(); !word.empty(); word = words.next()) {
    const std::optional<int> value = number<int>(word.substr(0, word.find('/')));
    const auto count = static_cast<std::int64_t>(mesh.vertices.size());
    const std::int64_t index = value ? (*value < 0 ? count + *value : std::int64_t{*value} - 1) : -1;
    if (index < 0 || index >= count) {
      return fail(Errc::kBadFormat, at_line(line) + "'" + std::string(word.substr(0, 32)) + "' names none of the " +
                                        std::to_string(count) + " vertices above");
    }
    corners.push_back(static_cast<std::size_t>(index));
  }
  if (corners.size() < 3) return fail(Errc::kBadFormat, at_line(line) + "a face needs three vertices or more");
  if (mesh.faces.size() + corners.size() - 2 > Envelope::kMaxTriangles) {
    return fail(Errc::kTooLarge,
                "more than " + std::to_string(Envelope::kMaxTriangles) + " triangles: simplify the mesh");
  }
  for (std::size_t k = 2; k < corners.size(); ++k)
    mesh.faces.push_back({{corners[0], corners[k - 1], corners[k]}, line});
  return {};
}

Result<Mesh> read_mesh(std::string_view text) {
  Mesh mesh;
  for (int line = 1; !text.empty(); ++line) {
    const std::size_t end = std::min(text.find('\n'), text.size());
    Words words(text.substr(0, end));
    text.remove_prefix(std::min(end + 1, text.size()));
    const std::string_view kind = words.next();
    if (kind == "v") {
      const Result<Vector3d> vertex = read_vertex(words, line);
      if (!vertex) return fail(vertex.error());
      mesh.vertices.push_back(*vertex);
    } else if (kind == "f") {
      if (const Status read = read_face(words, line, mesh); !read) return fail(read.error());
    }
  }
  if (mesh.faces.empty()) return fail(Errc::kBadFormat, "there is no face (a line that begins with f) in it");
  return mesh;
}

/// Every edge must belong to two triangles that run along it in opposite directions.
Status check_closed(const Mesh& mesh) {
  std::map<std::pair<std::size_t, std::size_t>, int> lines;  // of the triangle that runs along an edge
  for (const Face& face : mesh.faces) {
    for (std::size_t k = 0; k < 3; ++k) {
      const auto [at, fresh] = lines.emplace(std::pair(face.corners[k], face.corners[(k + 1) % 3]), face.line);
      if (!fresh) {
        return fail(Errc::kBadValue, at_line(face.line) +
                                         "the face folds over, or runs around the other way than, the one of line " +
                                         std::to_string(at->second) + ", which has the same edge");
      }
    }
  }
  for (const auto& [edge, line] : lines) {
    if (!lines.contains({edge.second, edge.first})) {
      return fail(Errc::kBadValue, at_line(line) + "a hole: no other face has the edge from vertex " +
                                       std::to_string(edge.first + 1) + " to " + std::to_string(edge.second + 1));
    }
  }
  return {};
}

/// The solid angle of a triangle (Van Oosterom and Strackee 1983).
double solid_angle_of(const std::array<Vector3d, 3>& t) {
  const double a = t[0].norm(), b = t[1].norm(), c = t[2].norm();
  return 2 *
         std::atan2(volume(t[0], t[1], t[2]), a * b * c + t[0].dot(t[1]) * c + t[1].dot(t[2]) * a + t[2].dot(t[0]) * b);
}

}  // namespace

Result<Envelope> Envelope::sphere(double radius) {
  if (!(radius > 0 && radius <= kLargest)) return fail(Errc::kBadValue, "the radius must be over 0 and at most 1e6 m");
  Envelope envelope;
  envelope.radius_ = radius;
  return envelope;
}

Result<Envelope> Envelope::from_obj(std::string_view text) {
  if (text.size() > kMaxObjBytes) {
    return fail(Errc::kTooLarge, "more than " + std::to_string(kMaxObjBytes) + " bytes: simplify the mesh");
  }
  const Result<Mesh> mesh = read_mesh(text);
  if (!mesh) return fail(mesh.error());
  if (const Status closed = check_closed(*mesh); !closed) return fail(closed.error());
  double inside = 0;
  for (const Face& face : mesh->faces) {
    const auto at = [&](std::size_t k) { return mesh->vertices[face.corners[k]]; };
    inside += volume(at(0), at(1), at(2));
  }
  Envelope envelope;
  double seen = 0;
  for (const Face& face : mesh->faces) {
    Triangle triangle{{}, face.line};
    for (std::size_t k = 0; k < 3; ++k) triangle.corners[k] = mesh->vertices[face.corners[inside < 0 ? 2 - k : k]];
    seen += solid_angle_of(triangle.corners);
    envelope.triangles_.push_back(triangle);
  }
  if (const Status good = envelope.check_eye(Vector3d::Zero()); !good) return fail(good.error());
  if (std::abs(seen - 4 * std::acos(-1.0)) > 1e-6) {
    return fail(Errc::kBadValue, "the mesh goes around the nodal point more than once");
  }
  return envelope;
}

Status Envelope::check_eye(const Vector3d& eye) const {
  if (radius_ > 0) {
    if (eye.norm() < radius_) return {};
    return fail(Errc::kBadValue, "the eye is not inside the sphere");
  }
  for (const Triangle& triangle : triangles_) {
    const auto& [a, b, c] = triangle.corners;
    const double depth = volume(a - eye, b - eye, c - eye);
    if (depth > 1e-12 * (b - a).cross(c - a).norm()) continue;
    return fail(Errc::kBadValue, (eye.isZero(0) ? "the nodal point (0, 0, 0)" : "the eye") +
                                     std::string(" does not see the inner side of the face of line ") +
                                     std::to_string(triangle.line) + ": it is outside of the mesh's kernel");
  }
  return {};
}

Vector3d Envelope::seen(const Vector3d& eye, const Ray& direction) const {
  const Vector3d& d = direction.direction();
  if (radius_ > 0) {
    const double b = eye.dot(d);
    return eye + (-b + std::sqrt(b * b + radius_ * radius_ - eye.squaredNorm())) * d;
  }
  // The triangle in whose cone the direction lies deepest: exactly one, but for rounding at edges.
  const Triangle* best = nullptr;
  double deepest = -std::numeric_limits<double>::infinity();
  for (const Triangle& triangle : triangles_) {
    const Vector3d a = triangle.corners[0] - eye, b = triangle.corners[1] - eye, c = triangle.corners[2] - eye;
    const double depth = std::min({volume(a, b, d) / a.cross(b).norm(), volume(b, c, d) / b.cross(c).norm(),
                                   volume(c, a, d) / c.cross(a).norm()});
    if (depth > deepest) deepest = depth, best = &triangle;
    if (depth > 1e-9) break;
  }
  const Vector3d a = best->corners[0] - eye;
  const Vector3d normal = (best->corners[1] - best->corners[0]).cross(best->corners[2] - best->corners[0]);
  return eye + normal.dot(a) / normal.dot(d) * d;
}

}  // namespace nodal::geometry
