// Reads binary glTF 2.0, see glb.h: the triangles of its scene.
#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <bit>
#include <limits>
#include <nlohmann/json.hpp>
#include <optional>
#include <utility>

#include "protocol/base/try.h"
#include "stitch/mesh/formats.h"
#include "stitch/mesh/glb.h"

namespace nodal::mesh {
namespace {

using namespace glb;
using Json = nlohmann::json;

constexpr std::size_t kMaxJson = 1 << 20;  // a parser takes many times as much memory
constexpr std::size_t kMaxParts = 4096;
constexpr std::uint64_t kNone = std::numeric_limits<std::uint64_t>::max();

std::uint32_t word_at(std::span<const std::uint8_t> bytes, std::size_t at, std::size_t size = 4) {
  std::uint32_t word = 0;
  for (std::size_t k = 0; k < size; ++k) word |= std::uint32_t{bytes[at + k]} << (8 * k);
  return word;
}

/// A whole number of a JSON object; `otherwise` if it is not there. Nothing if it is no whole number.
std::optional<std::uint64_t> whole(const Json& object, const char* key, std::uint64_t otherwise) {
  const auto found = object.find(key);
  if (found == object.end()) return otherwise;
  return found->is_number_unsigned() ? std::optional(found->get<std::uint64_t>()) : std::nullopt;
}

/// An element of an array of a JSON object, or null.
const Json* element(const Json& object, const char* key, std::uint64_t index) {
  const auto found = object.find(key);
  return found != object.end() && found->is_array() && index < found->size() && (*found)[index].is_object()
             ? &(*found)[index]
             : nullptr;
}

/// A column of numbers in the buffers.
struct Column {
  std::size_t begin = 0, stride = 0, count = 0;
  std::uint64_t type = 0;
};

std::size_t size_of(std::uint64_t type) { return type == kByte ? 1 : type == kShort ? 2 : 4; }

Result<Column> column_of(const Json& root, std::uint64_t accessor, std::size_t buffer_size, std::size_t width,
                         const std::string& what) {
  const auto bad = [&](const std::string& why) { return fail(Errc::kBadFormat, what + ": " + why); };
  const Json* its = element(root, "accessors", accessor);
  if (its == nullptr) return bad(fmt::format("there is no accessor {}", accessor));
  const Json* view = element(root, "bufferViews", whole(*its, "bufferView", kNone).value_or(kNone));
  if (view == nullptr || its->contains("sparse")) return bad("its accessor has no plain bufferView");
  Column column;
  const auto type = whole(*its, "componentType", 0), count = whole(*its, "count", 0);
  const auto offset = whole(*its, "byteOffset", 0), begin = whole(*view, "byteOffset", 0);
  const auto length = whole(*view, "byteLength", 0), buffer = whole(*view, "buffer", kNone);
  const auto stride = whole(*view, "byteStride", 0);
  const std::array types{"", "SCALAR", "VEC2", "VEC3"};
  const auto shape = its->find("type");
  if (!type || !count || !offset || !begin || !length || buffer != 0 || !stride || shape == its->end() ||
      *shape != types[width] || (width > 1 ? *type != kFloat : *type != kByte && *type != kShort && *type != kInt)) {
    return bad(width > 1 ? "it must be " + std::string(types[width]) + " of floats (componentType 5126) in buffer 0"
                         : "it must be SCALAR of whole numbers (componentType 5121, 5123 or 5125) in buffer 0");
  }
  if (*count > 3 * kMaxMeshTriangles)
    return fail(Errc::kTooLarge, fmt::format("{}: more than {} elements", what, 3 * kMaxMeshTriangles));
  const std::size_t element_size = width * size_of(*type);
  column.type = *type, column.count = *count, column.stride = *stride == 0 ? element_size : *stride;
  const std::uint64_t limit = buffer_size;
  const bool in_buffer = *begin <= limit && *length <= limit - *begin;
  if (!in_buffer || *offset > *length || column.stride < element_size || column.stride > 252 ||
      (column.count > 0 && (column.count - 1) * column.stride + element_size > *length - *offset)) {
    return fail(Errc::kTruncated, what + ": it reaches beyond its buffer");
  }
  column.begin = *begin + *offset;
  return column;
}

double number_at(std::span<const std::uint8_t> buffer, const Column& column, std::size_t row, std::size_t k) {
  return std::bit_cast<float>(word_at(buffer, column.begin + row * column.stride + 4 * k));
}

/// The `count` numbers of an array of a JSON object; nothing if it has not as many finite ones.
std::optional<std::vector<double>> numbers(const Json& object, const char* key, std::size_t count) {
  const auto found = object.find(key);
  if (found == object.end() || !found->is_array() || found->size() != count) return std::nullopt;
  std::vector<double> read;
  for (const Json& each : *found) {
    if (!each.is_number() || !(std::abs(each.get<double>()) <= 1e9)) return std::nullopt;
    read.push_back(each.get<double>());
  }
  return read;
}

/// From a node's space into its parent's: its matrix, or its translation, rotation and scale.
Result<Eigen::Affine3d> transform_of(const Json& node, const std::string& what) {
  Eigen::Affine3d made = Eigen::Affine3d::Identity();
  const auto read = [&](const char* key, std::size_t count, std::vector<double>& into) {
    if (!node.contains(key)) return true;
    const auto found = numbers(node, key, count);
    if (found) into = *found;
    return found.has_value();
  };
  std::vector<double> matrix, translation{0, 0, 0}, rotation{0, 0, 0, 1}, scale{1, 1, 1};
  if (!read("matrix", 16, matrix) || !read("translation", 3, translation) || !read("rotation", 4, rotation) ||
      !read("scale", 3, scale)) {
    return fail(Errc::kBadFormat, what + ": its matrix, translation, rotation or scale is not 16, 3, 4 or 3 numbers");
  }
  if (!matrix.empty()) {
    made.matrix() = Eigen::Matrix4d(matrix.data());  // columns first, in both
    made.makeAffine();
    return made;
  }
  const Eigen::Quaterniond turn(rotation[3], rotation[0], rotation[1], rotation[2]);
  if (!(turn.norm() > 1e-6)) return fail(Errc::kBadFormat, what + ": its rotation is no unit quaternion");
  made.translate(Eigen::Vector3d(translation.data())).rotate(turn.normalized()).scale(Eigen::Vector3d(scale.data()));
  return made;
}

/// Collects triangles, primitive by primitive.
class SceneReader {
 public:
  SceneReader(const Json& root, std::span<const std::uint8_t> buffer, bool textured)
      : root_(root), buffer_(buffer), textured_(textured) {}

  /// The default scene; of a file without scenes, all meshes.
  Result<FileMesh> read() {
    const Json* const scene = element(root_, "scenes", whole(root_, "scene", 0).value_or(kNone));
    if (scene != nullptr) {
      NODAL_TRY(add_nodes(*scene, "nodes", Eigen::Affine3d::Identity(), 0));
    } else {
      for (std::uint64_t k = 0; element(root_, "meshes", k) != nullptr; ++k) {
        NODAL_TRY(add_mesh(k, Eigen::Affine3d::Identity()));
      }
    }
    if (mesh_.triangles.empty()) return fail(Errc::kBadFormat, "there is no triangle in its scene");
    return std::move(mesh_);
  }

 private:
  /// The nodes that an object lists, with their children.
  Status add_nodes(const Json& of, const char* key, const Eigen::Affine3d& to_scene, int depth) {
    constexpr int kMaxDepth = 64;
    const auto list = of.find(key);
    if (list == of.end()) return {};
    if (!list->is_array() || depth > kMaxDepth)
      return fail(Errc::kBadFormat, fmt::format("its nodes are no lists, or are nested deeper than {}", kMaxDepth));
    for (const Json& index : *list) {
      const std::uint64_t number = index.is_number_unsigned() ? index.get<std::uint64_t>() : kNone;
      const Json* const node = element(root_, "nodes", number);
      if (node == nullptr) return fail(Errc::kBadFormat, "its scene names a node that is not there: " + index.dump());
      const std::string what = fmt::format("nodes[{}]", number);
      NODAL_TRY(count(what));
      NODAL_TRY_ASSIGN(const Eigen::Affine3d own, transform_of(*node, what));
      const Eigen::Affine3d place = to_scene * own;
      if (node->contains("mesh")) {
        NODAL_TRY(add_mesh(whole(*node, "mesh", kNone).value_or(kNone), place));
      }
      NODAL_TRY(add_nodes(*node, "children", place, depth + 1));
    }
    return {};
  }

  /// Counts nodes and primitives, each as often as the scene names it.
  Status count(const std::string& what) {
    if (++parts_ <= kMaxParts) return {};
    return fail(Errc::kTooLarge, fmt::format("{}: more than {} nodes and primitives in the scene, or nodes in a circle",
                                             what, kMaxParts));
  }

  Status add_mesh(std::uint64_t number, const Eigen::Affine3d& to_scene) {
    const Json* const mesh = element(root_, "meshes", number);
    if (mesh == nullptr || element(*mesh, "primitives", 0) == nullptr)
      return fail(Errc::kBadFormat, "its scene names a mesh that is not there, or that has no primitives");
    for (std::size_t k = 0; k < mesh->at("primitives").size(); ++k) {
      const std::string what = fmt::format("meshes[{}].primitives[{}]", number, k);
      const Json* const primitive = element(*mesh, "primitives", k);
      if (primitive == nullptr) return fail(Errc::kBadFormat, what + ": it is no object");
      NODAL_TRY(count(what));
      NODAL_TRY(add_primitive(*primitive, what, to_scene));
    }
    return {};
  }

  Result<Column> column(const Json& in, const char* key, std::size_t width, const std::string& what) const {
    return column_of(root_, whole(in, key, kNone).value_or(kNone), buffer_.size(), width, what + "." + key);
  }

  Status add_primitive(const Json& primitive, const std::string& what, const Eigen::Affine3d& to_scene) {
    if (whole(primitive, "mode", 4) != 4U)
      return fail(Errc::kUnsupported, what + ": it is not made of triangles (mode 4)");
    const auto attributes = primitive.find("attributes");
    if (attributes == primitive.end() || !attributes->is_object() || !attributes->contains("POSITION") ||
        (textured_ && !attributes->contains("TEXCOORD_0"))) {
      return fail(Errc::kMissingField,
                  what + (textured_ ? ": it needs POSITION and TEXCOORD_0; of a mesh without them, "
                                      "only the shape can be used: --envelope"
                                    : ": it needs POSITION"));
    }
    NODAL_TRY_ASSIGN(const Column points, column(*attributes, "POSITION", 3, what));
    Result<Column> textures(Column{}), indices(Column{});
    if (textured_) textures = column(*attributes, "TEXCOORD_0", 2, what);
    const bool listed = primitive.contains("indices");
    if (listed) indices = column(primitive, "indices", 1, what);
    for (const Result<Column>* each : {&textures, &indices}) {
      if (!*each) return fail(each->error());
    }
    const std::size_t corners = listed ? indices->count : points.count;
    if ((textured_ && points.count != textures->count) || corners % 3 != 0)
      return fail(Errc::kBadFormat,
                  what + ": POSITION and TEXCOORD_0 differ in count, or corners are not three a triangle");
    if (mesh_.triangles.size() + corners / 3 > kMaxMeshTriangles ||
        mesh_.points.size() + points.count > 3 * kMaxMeshTriangles) {
      return fail(Errc::kTooLarge, fmt::format("more than {} triangles: simplify the mesh", kMaxMeshTriangles));
    }
    const std::size_t first = mesh_.points.size();
    for (std::size_t k = 0; k < points.count; ++k) {
      const auto number = [&](const Column& of, std::size_t c) { return number_at(buffer_, of, k, c); };
      const Eigen::Vector3d own(number(points, 0), number(points, 1), number(points, 2));
      mesh_.points.push_back(turned_over(to_scene * own));
      mesh_.textures.emplace_back(textured_ ? number(*textures, 0) : 0, textured_ ? number(*textures, 1) : 0);
    }
    const bool mirrored = to_scene.linear().determinant() < 0;  // triangles then run around the other way
    for (std::size_t k = 0; k < corners; ++k) {
      const std::size_t index =
          listed ? word_at(buffer_, indices->begin + k * indices->stride, size_of(indices->type)) : k;
      if (index >= points.count) {
        return fail(Errc::kBadFormat, fmt::format("{}: triangle {}: there is no vertex {}; there are {}", what,
                                                  k / 3 + 1, index, points.count));
      }
      if (k % 3 == 0) mesh_.triangles.emplace_back();
      mesh_.triangles.back()[mirrored ? 2 - k % 3 : k % 3] = static_cast<std::uint32_t>(first + index);
    }
    return {};
  }

  const Json& root_;
  std::span<const std::uint8_t> buffer_;
  bool textured_;
  std::size_t parts_ = 0;
  FileMesh mesh_;
};

}  // namespace

Result<FileMesh> decode_glb(std::span<const std::uint8_t> bytes, bool textured) {
  if (bytes.size() < 20 || word_at(bytes, 0) != kMagic || word_at(bytes, 4) != 2)
    return fail(Errc::kBadFormat, "it is no binary glTF of version 2 (.glb)");
  const std::size_t json_size = word_at(bytes, 12);
  if (word_at(bytes, 8) > bytes.size() || json_size > bytes.size() - 20)
    return fail(Errc::kTruncated, "the file is shorter than it says");
  if (json_size > kMaxJson) return fail(Errc::kTooLarge, fmt::format("its JSON has more than {} bytes", kMaxJson));
  if (word_at(bytes, 16) != kJsonChunk) return fail(Errc::kBadFormat, "its first chunk is not JSON");
  const auto* text = reinterpret_cast<const char*>(bytes.data()) + 20;
  const Json root = Json::parse(text, text + json_size, nullptr, false);
  if (!root.is_object()) return fail(Errc::kBadFormat, "its first chunk is not a JSON object");
  std::span<const std::uint8_t> buffer = bytes.subspan(20 + json_size);
  if (buffer.size() < 8 || word_at(buffer, 4) != kBinChunk || word_at(buffer, 0) > buffer.size() - 8)
    return fail(Errc::kTruncated, "there is no whole chunk of buffers (BIN) in it; other files are not read");
  buffer = buffer.subspan(8, word_at(buffer, 0));
  return SceneReader(root, buffer, textured).read();
}

}  // namespace nodal::mesh
