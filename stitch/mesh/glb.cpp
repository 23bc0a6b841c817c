// Binary glTF 2.0 (Khronos): a header of 12 bytes, a chunk of JSON, a chunk of buffers; little-endian.
#include <algorithm>
#include <array>
#include <bit>
#include <cstring>
#include <limits>
#include <nlohmann/json.hpp>
#include <optional>
#include <utility>

#include "stitch/mesh/formats.h"

namespace nodal::mesh {
namespace {

using Json = nlohmann::json;

constexpr std::uint32_t kMagic = 0x4654'6C67, kJsonChunk = 0x4E4F'534A, kBinChunk = 0x004E'4942;
constexpr std::size_t kMaxJson = 1 << 20;  // a parser takes many times as much memory
constexpr int kFloat = 5126, kByte = 5121, kShort = 5123, kInt = 5125;

void put(std::vector<std::uint8_t>& bytes, std::uint32_t word) {
  for (int k = 0; k < 4; ++k) bytes.push_back(static_cast<std::uint8_t>(word >> (8 * k)));
}

std::uint32_t word_at(std::span<const std::uint8_t> bytes, std::size_t at, std::size_t size = 4) {
  std::uint32_t word = 0;
  for (std::size_t k = 0; k < size; ++k) word |= std::uint32_t{bytes[at + k]} << (8 * k);
  return word;
}

std::vector<std::uint8_t> padded(std::vector<std::uint8_t> bytes, std::uint8_t with) {
  bytes.resize((bytes.size() + 3) / 4 * 4, with);
  return bytes;
}

/// A name as a relative URI: what is not allowed in one, as %XX (RFC 3986).
std::string uri_of(const std::string& name) {
  std::string uri;
  for (const char c : name) {
    const auto byte = static_cast<unsigned char>(c);
    const bool plain = (c >= '0' && c <= '9') || (c >= 'A' && c <= 'Z') || (c >= 'a' && c <= 'z') ||
                       std::string_view("-._~/").find(c) != std::string_view::npos;
    constexpr std::string_view kDigits = "0123456789ABCDEF";
    uri += plain ? std::string(1, c) : std::string{'%', kDigits[byte / 16], kDigits[byte % 16]};
  }
  return uri;
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
  if (its == nullptr) return bad("there is no accessor " + std::to_string(accessor));
  constexpr std::uint64_t kNone = std::numeric_limits<std::uint64_t>::max();
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
    return fail(Errc::kTooLarge, what + ": more than " + std::to_string(3 * kMaxMeshTriangles) + " elements");
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

}  // namespace

Result<std::vector<std::uint8_t>> encode_glb(const Raymesh& mesh, const std::string& texture) {
  std::vector<std::uint8_t> buffer;
  const auto put_float = [&](double value) { put(buffer, std::bit_cast<std::uint32_t>(static_cast<float>(value))); };
  Eigen::Vector3f least = Eigen::Vector3f::Constant(std::numeric_limits<float>::max()), most = -least;
  for (std::uint32_t k = 0; k < mesh.vertices.size(); ++k) {
    const Eigen::Vector3d point = turned_over(mesh.point(k));
    least = least.cwiseMin(point.cast<float>()), most = most.cwiseMax(point.cast<float>());
    for (const double coordinate : point) put_float(coordinate);
  }
  for (const Raymesh::Vertex& vertex : mesh.vertices) {
    for (const double coordinate : vertex.texture) put_float(coordinate);
  }
  for (const Raymesh::Triangle& triangle : mesh.triangles) {
    for (const std::uint32_t vertex : triangle) put(buffer, vertex);
  }
  const std::size_t count = mesh.vertices.size(), indices = 3 * mesh.triangles.size();
  Json material{{"extensions", {{"KHR_materials_unlit", Json::object()}}},
                {"pbrMetallicRoughness", {{"metallicFactor", 0}, {"roughnessFactor", 1}}},
                {"doubleSided", true}};
  Json root{
      {"asset", {{"version", "2.0"}, {"generator", "nodal mesh"}}},
      {"extensionsUsed", {"KHR_materials_unlit"}},
      {"scene", 0},
      {"scenes", {{{"nodes", {0}}}}},
      {"nodes", {{{"mesh", 0}}}},
      {"meshes",
       {{{"primitives", {{{"attributes", {{"POSITION", 0}, {"TEXCOORD_0", 1}}}, {"indices", 2}, {"material", 0}}}}}}},
      {"accessors",
       {{{"bufferView", 0},
         {"componentType", kFloat},
         {"count", count},
         {"type", "VEC3"},
         {"min", {least.x(), least.y(), least.z()}},
         {"max", {most.x(), most.y(), most.z()}}},
        {{"bufferView", 1}, {"componentType", kFloat}, {"count", count}, {"type", "VEC2"}},
        {{"bufferView", 2}, {"componentType", kInt}, {"count", indices}, {"type", "SCALAR"}}}},
      {"bufferViews",
       {{{"buffer", 0}, {"byteOffset", 0}, {"byteLength", 12 * count}, {"target", 34962}},
        {{"buffer", 0}, {"byteOffset", 12 * count}, {"byteLength", 8 * count}, {"target", 34962}},
        {{"buffer", 0}, {"byteOffset", 20 * count}, {"byteLength", 4 * indices}, {"target", 34963}}}},
      {"buffers", {{{"byteLength", buffer.size()}}}}};
  if (!texture.empty()) {
    material["pbrMetallicRoughness"]["baseColorTexture"] = {{"index", 0}};
    root["textures"] = {{{"sampler", 0}, {"source", 0}}};
    root["images"] = {{{"uri", uri_of(texture)}}};
    // Linear; around the sphere a raymap goes on at its other side.
    root["samplers"] = {{{"magFilter", 9729}, {"minFilter", 9729}, {"wrapS", 10497}, {"wrapT", 33071}}};
  }
  root["materials"] = Json::array({material});
  const std::string text = root.dump();
  const std::vector<std::uint8_t> json = padded({text.begin(), text.end()}, ' ');
  std::vector<std::uint8_t> bytes;
  for (const std::size_t word :
       {std::size_t{kMagic}, std::size_t{2}, 28 + json.size() + buffer.size(), json.size(), std::size_t{kJsonChunk}})
    put(bytes, static_cast<std::uint32_t>(word));
  bytes.insert(bytes.end(), json.begin(), json.end());
  put(bytes, static_cast<std::uint32_t>(buffer.size()));
  put(bytes, kBinChunk);
  bytes.insert(bytes.end(), buffer.begin(), buffer.end());
  return bytes;
}

Result<FileMesh> decode_glb(std::span<const std::uint8_t> bytes) {
  if (bytes.size() < 20 || word_at(bytes, 0) != kMagic || word_at(bytes, 4) != 2)
    return fail(Errc::kBadFormat, "it is no binary glTF of version 2 (.glb)");
  const std::size_t json_size = word_at(bytes, 12);
  if (word_at(bytes, 8) > bytes.size() || json_size > bytes.size() - 20)
    return fail(Errc::kTruncated, "the file is shorter than it says");
  if (json_size > kMaxJson)
    return fail(Errc::kTooLarge, "its JSON has more than " + std::to_string(kMaxJson) + " bytes");
  if (word_at(bytes, 16) != kJsonChunk) return fail(Errc::kBadFormat, "its first chunk is not JSON");
  const auto* text = reinterpret_cast<const char*>(bytes.data()) + 20;
  const Json root = Json::parse(text, text + json_size, nullptr, false);
  if (!root.is_object()) return fail(Errc::kBadFormat, "its first chunk is not a JSON object");
  std::span<const std::uint8_t> buffer = bytes.subspan(20 + json_size);
  if (buffer.size() < 8 || word_at(buffer, 4) != kBinChunk || word_at(buffer, 0) > buffer.size() - 8)
    return fail(Errc::kTruncated, "there is no whole chunk of buffers (BIN) in it; other files are not read");
  buffer = buffer.subspan(8, word_at(buffer, 0));
  const Json* first = element(root, "meshes", 0);
  const Json* primitive = first == nullptr ? nullptr : element(*first, "primitives", 0);
  if (primitive == nullptr || whole(*primitive, "mode", 4) != 4U)
    return fail(Errc::kUnsupported, "meshes[0].primitives[0] is not there, or is not made of triangles (mode 4)");
  const auto attributes = primitive->find("attributes");
  if (attributes == primitive->end() || !attributes->is_object() || !attributes->contains("POSITION") ||
      !attributes->contains("TEXCOORD_0") || !primitive->contains("indices")) {
    return fail(Errc::kMissingField, "meshes[0].primitives[0] needs POSITION, TEXCOORD_0 and indices");
  }
  constexpr std::uint64_t kNone = std::numeric_limits<std::uint64_t>::max();
  const auto column = [&](const Json& in, const char* key, std::size_t width) {
    return column_of(root, whole(in, key, kNone).value_or(kNone), buffer.size(), width, key);
  };
  const Result<Column> points = column(*attributes, "POSITION", 3), textures = column(*attributes, "TEXCOORD_0", 2),
                       indices = column(*primitive, "indices", 1);
  for (const Result<Column>* each : {&points, &textures, &indices}) {
    if (!*each) return fail(each->error());
  }
  if (points->count != textures->count || indices->count % 3 != 0)
    return fail(Errc::kBadFormat, "POSITION and TEXCOORD_0 differ in count, or indices are not three a triangle");
  FileMesh mesh;
  for (std::size_t k = 0; k < points->count; ++k) {
    mesh.points.push_back(turned_over(
        {number_at(buffer, *points, k, 0), number_at(buffer, *points, k, 1), number_at(buffer, *points, k, 2)}));
    mesh.textures.emplace_back(number_at(buffer, *textures, k, 0), number_at(buffer, *textures, k, 1));
  }
  for (std::size_t k = 0; k < indices->count; ++k) {
    const std::uint32_t index = word_at(buffer, indices->begin + k * indices->stride, size_of(indices->type));
    if (index >= points->count) {
      return fail(Errc::kBadFormat, "triangle " + std::to_string(k / 3 + 1) + ": there is no vertex " +
                                        std::to_string(index) + "; there are " + std::to_string(points->count));
    }
    if (k % 3 == 0) mesh.triangles.emplace_back();
    mesh.triangles.back()[k % 3] = index;
  }
  if (mesh.triangles.size() > kMaxMeshTriangles)
    return fail(Errc::kTooLarge, "more than " + std::to_string(kMaxMeshTriangles) + " triangles: simplify the mesh");
  return mesh;
}

}  // namespace nodal::mesh
