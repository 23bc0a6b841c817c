// Writes binary glTF 2.0, see glb.h.
#include <algorithm>
#include <array>
#include <bit>
#include <limits>
#include <nlohmann/json.hpp>

#include "stitch/mesh/formats.h"
#include "stitch/mesh/glb.h"

namespace nodal::mesh {
namespace {

using namespace glb;
using Json = nlohmann::json;

void put(std::vector<std::uint8_t>& bytes, std::uint32_t word) {
  for (int k = 0; k < 4; ++k) bytes.push_back(static_cast<std::uint8_t>(word >> (8 * k)));
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

}  // namespace nodal::mesh
