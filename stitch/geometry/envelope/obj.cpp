#include "stitch/geometry/envelope/obj.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <map>
#include <optional>
#include <utility>

#include "protocol/base/try.h"
#include "stitch/geometry/envelope/solid.h"

namespace nodal::geometry {
namespace {

std::string at_line(int line) { return fmt::format("line {}: ", line); }

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

template <class Vector>
Result<Vector> read_numbers(Words words, int line, const std::string& what) {
  Vector read;
  for (double& coordinate : read) {
    const std::optional<double> value = number<double>(words.next());
    if (!value || !(std::abs(*value) <= kLargestEnvelope)) return fail(Errc::kBadFormat, at_line(line) + what);
    coordinate = *value;
  }
  return read;
}

/// The index that a word means: from 1, or negative, counted back from the last. Nothing if it is none of `count`.
std::optional<std::uint32_t> index_of(std::string_view word, std::size_t count) {
  const std::optional<int> value = number<int>(word);
  const std::int64_t from_first = std::int64_t{value.value_or(0)} - 1;
  const std::int64_t index = value && *value < 0 ? static_cast<std::int64_t>(count) + *value : from_first;
  if (index < 0 || index >= static_cast<std::int64_t>(count)) return std::nullopt;
  return static_cast<std::uint32_t>(index);
}

Status read_face(Words words, int line, std::size_t most_triangles, ObjMesh& mesh) {
  std::vector<ObjMesh::Corner> corners;
  for (std::string_view word = words.next(); !word.empty(); word = words.next()) {
    const std::string shown(word.substr(0, 32));
    const std::size_t slash = std::min(word.find('/'), word.size());
    const std::optional<std::uint32_t> vertex = index_of(word.substr(0, slash), mesh.vertices.size());
    if (!vertex) {
      return fail(Errc::kBadFormat, fmt::format("{}'{}' names none of the {} vertices above", at_line(line), shown,
                                                mesh.vertices.size()));
    }
    ObjMesh::Corner corner{*vertex, ObjMesh::kNone};
    word.remove_prefix(std::min(slash + 1, word.size()));
    if (const std::string_view second = word.substr(0, word.find('/')); !second.empty()) {
      const std::optional<std::uint32_t> texture = index_of(second, mesh.textures.size());
      if (!texture) {
        return fail(Errc::kBadFormat, fmt::format("{}'{}' names none of the {} texture coordinates (vt) above",
                                                  at_line(line), shown, mesh.textures.size()));
      }
      corner.texture = *texture;
    }
    corners.push_back(corner);
  }
  if (corners.size() < 3) return fail(Errc::kBadFormat, at_line(line) + "a face needs three vertices or more");
  if (mesh.triangles.size() + corners.size() - 2 > most_triangles)
    return fail(Errc::kTooLarge, fmt::format("more than {} triangles: simplify the mesh", most_triangles));
  for (std::size_t k = 2; k < corners.size(); ++k)
    mesh.triangles.push_back({{corners[0], corners[k - 1], corners[k]}, line});
  return {};
}

}  // namespace

Result<ObjMesh> read_obj(std::string_view text, std::size_t most_bytes, std::size_t most_triangles) {
  if (text.size() > most_bytes)
    return fail(Errc::kTooLarge, fmt::format("more than {} bytes: simplify the mesh", most_bytes));
  ObjMesh mesh;
  for (int line = 1; !text.empty(); ++line) {
    const std::size_t end = std::min(text.find('\n'), text.size());
    Words words(text.substr(0, end));
    text.remove_prefix(std::min(end + 1, text.size()));
    const std::string_view kind = words.next();
    if (kind == "v") {
      NODAL_TRY_ASSIGN(const auto vertex, read_numbers<Eigen::Vector3d>(
                                              words, line, "after v there must be three numbers, metres, up to 1e6"));
      mesh.vertices.push_back(vertex);
    } else if (kind == "vt") {
      NODAL_TRY_ASSIGN(const auto texture,
                       read_numbers<Eigen::Vector2d>(words, line, "after vt there must be two numbers"));
      mesh.textures.push_back(texture);
    } else if (kind == "f") {
      NODAL_TRY(read_face(words, line, most_triangles, mesh));
    }
  }
  if (mesh.triangles.empty()) return fail(Errc::kBadFormat, "there is no face (a line that begins with f) in it");
  return mesh;
}

Status check_closed(const ObjMesh& mesh) {
  const auto at = [&](int number) { return fmt::format("{} {}", mesh.counted, number); };
  // Triangle::line of the triangle that runs along an edge.
  std::map<std::pair<std::uint32_t, std::uint32_t>, int> lines;
  for (const ObjMesh::Triangle& triangle : mesh.triangles) {
    for (std::size_t k = 0; k < 3; ++k) {
      const auto edge = std::pair(triangle.corners[k].vertex, triangle.corners[(k + 1) % 3].vertex);
      const auto [other, fresh] = lines.emplace(edge, triangle.line);
      if (!fresh) {
        return fail(Errc::kBadValue, at(triangle.line) +
                                         ": the face folds over, or runs around the other way than, the one of " +
                                         at(other->second) + ", which has the same edge");
      }
    }
  }
  for (const auto& [edge, line] : lines) {
    if (!lines.contains({edge.second, edge.first})) {
      return fail(Errc::kBadValue, fmt::format("{}: a hole: no other face has the edge from vertex {} to {}", at(line),
                                               edge.first + 1, edge.second + 1));
    }
  }
  return {};
}

}  // namespace nodal::geometry
