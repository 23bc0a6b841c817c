// The mesh projection box of spherical video V2 (Google, "Spherical Video V2 RFC"): big-endian, a list of different
// coordinates, and vertices and triangles as differences of indices in as many bits as the largest needs.
#include <fmt/format.h>

#include <zlib.h>

#include <algorithm>
#include <array>
#include <bit>
#include <map>
#include <string>
#include <string_view>

#include "stitch/mesh/formats.h"

namespace nodal::mesh {
namespace {

// What ExoPlayer takes.
constexpr std::uint32_t kMaxCoordinates = 10'000, kMaxVertices = 32'000, kMaxIndices = 128'000;

/// Bits of the difference of two indices of `count` things, zig-zag: ceil(log2(2 count)).
int bits_for(std::uint32_t count) { return static_cast<int>(std::bit_width(2 * count - 1)); }

class BitWriter {
 public:
  void put(std::uint64_t value, int bits) {
    for (int k = bits - 1; k >= 0; --k) {
      if (used_ % 8 == 0) bytes_.push_back(0);
      bytes_.back() |= static_cast<std::uint8_t>((value >> k & 1) << (7 - used_++ % 8));
    }
  }
  void put_difference(std::int64_t difference, int bits) {
    put(static_cast<std::uint64_t>(difference < 0 ? -2 * difference - 1 : 2 * difference), bits);
  }
  void align() { used_ = (used_ + 7) / 8 * 8; }
  void put_name(std::string_view name) {
    for (const char c : name) put(static_cast<std::uint8_t>(c), 8);
  }
  void put_all(std::span<const std::uint8_t> bytes) {
    for (const std::uint8_t byte : bytes) put(byte, 8);
  }
  const std::vector<std::uint8_t>& bytes() const { return bytes_; }

 private:
  std::vector<std::uint8_t> bytes_;
  std::size_t used_ = 0;
};

class BitReader {
 public:
  explicit BitReader(std::span<const std::uint8_t> bytes) : bytes_(bytes) {}
  /// 0 beyond the end; then good() is false.
  std::uint32_t get(int bits) {
    std::uint32_t value = 0;
    for (int k = 0; k < bits; ++k) {
      if (at_ / 8 >= bytes_.size()) {
        good_ = false;
        return 0;
      }
      value = value << 1 | (bytes_[at_ / 8] >> (7 - at_ % 8) & 1U);
      ++at_;
    }
    return value;
  }
  std::int64_t get_difference(int bits) {
    const std::int64_t code = get(bits);
    return code % 2 != 0 ? -(code + 1) / 2 : code / 2;
  }
  void align() { at_ = (at_ + 7) / 8 * 8; }
  bool good() const { return good_; }
  std::size_t left() const { return bytes_.size() - std::min(bytes_.size(), at_ / 8); }
  std::span<const std::uint8_t> rest() const { return bytes_.subspan(bytes_.size() - left()); }

 private:
  std::span<const std::uint8_t> bytes_;
  std::size_t at_ = 0;
  bool good_ = true;
};

std::vector<std::uint8_t> box(std::string_view name, std::span<const std::uint8_t> payload) {
  BitWriter writer;
  writer.put(payload.size() + 8, 32);
  writer.put_name(name);
  writer.put_all(payload);
  return writer.bytes();
}

/// x, y, z, u, v as the box has them: u and v from the lower left.
std::array<double, 5> numbers_of(const Raymesh& mesh, std::uint32_t vertex) {
  const Eigen::Vector3d point = turned_over(mesh.point(vertex));
  const Eigen::Vector2d& texture = mesh.vertices[vertex].texture;
  return {point.x(), point.y(), point.z(), texture.x(), 1 - texture.y()};
}

std::vector<std::uint8_t> inflated(std::span<const std::uint8_t> deflated) {
  std::vector<std::uint8_t> bytes(kMaxMeshFileBytes / 8);
  z_stream stream{};
  if (inflateInit2(&stream, -MAX_WBITS) != Z_OK) return {};
  stream.next_in = const_cast<Bytef*>(deflated.data());
  stream.avail_in = static_cast<uInt>(deflated.size());
  stream.next_out = bytes.data();
  stream.avail_out = static_cast<uInt>(bytes.size());
  const int end = inflate(&stream, Z_FINISH);
  bytes.resize(end == Z_STREAM_END ? stream.total_out : 0);
  inflateEnd(&stream);
  return bytes;
}

/// Three corners of each triangle of a list of indices: 0 triangles, 1 a strip, 2 a fan.
std::vector<std::array<std::uint32_t, 3>> triangles_of(std::uint32_t type, const std::vector<std::uint32_t>& list) {
  std::vector<std::array<std::uint32_t, 3>> triangles;
  for (std::size_t k = 2; k < list.size(); k += type == 0 ? 3 : 1) {
    std::array<std::uint32_t, 3> triangle{list[k - 2], list[k - 1], list[k]};
    if (type == 1 && k % 2 != 0) std::swap(triangle[0], triangle[1]);
    if (type == 2) triangle[0] = list[0];
    // Strips turn by triangles without an area.
    const bool flat = triangle[0] == triangle[1] || triangle[1] == triangle[2] || triangle[2] == triangle[0];
    if (type == 0 || !flat) triangles.push_back(triangle);
  }
  return triangles;
}

Result<FileMesh> decode_mesh_box(std::span<const std::uint8_t> bytes) {
  const auto cut_short = [] { return fail(Errc::kTruncated, "the mesh box ends in the middle"); };
  const auto too_many = [](const char* what, std::uint32_t most) {
    return fail(Errc::kTooLarge, fmt::format("there are none, or more than {}, {} in the mesh box", most, what));
  };
  BitReader reader(bytes);
  const std::uint32_t coordinates = reader.get(32);
  if (coordinates == 0 || coordinates > kMaxCoordinates) return too_many("coordinates", kMaxCoordinates);
  std::vector<float> values;
  for (std::uint32_t k = 0; k < coordinates; ++k) values.push_back(std::bit_cast<float>(reader.get(32)));
  const std::uint32_t vertices = reader.get(32);
  if (!reader.good()) return cut_short();
  if (vertices == 0 || vertices > kMaxVertices) return too_many("vertices", kMaxVertices);
  FileMesh mesh;
  std::array<std::int64_t, 5> at{};
  for (std::uint32_t k = 0; k < vertices; ++k) {
    std::array<double, 5> numbers{};
    for (std::size_t n = 0; n < 5; ++n) {
      at[n] += reader.get_difference(bits_for(coordinates));
      if (at[n] < 0 || at[n] >= coordinates)
        return fail(Errc::kBadFormat, fmt::format("vertex {} names a coordinate that is not there", k + 1));
      numbers[n] = values[static_cast<std::size_t>(at[n])];
    }
    mesh.points.push_back(turned_over({numbers[0], numbers[1], numbers[2]}));
    mesh.textures.emplace_back(numbers[3], 1 - numbers[4]);
  }
  reader.align();
  const std::uint32_t lists = reader.get(32);
  std::uint32_t left = kMaxIndices;
  for (std::uint32_t k = 0; k < lists && reader.good(); ++k) {
    reader.get(8);  // the texture
    const std::uint32_t type = reader.get(8), count = reader.get(32);
    if (type > 2) return fail(Errc::kUnsupported, fmt::format("list {} of the mesh box has an unknown type", k + 1));
    if (count > left) return too_many("indices", kMaxIndices);
    left -= count;
    std::vector<std::uint32_t> list;
    std::int64_t index = 0;
    for (std::uint32_t n = 0; n < count && reader.good(); ++n) {
      index += reader.get_difference(bits_for(vertices));
      if (index < 0 || index >= vertices)
        return fail(Errc::kBadFormat, fmt::format("list {} names a vertex that is not there", k + 1));
      list.push_back(static_cast<std::uint32_t>(index));
    }
    reader.align();
    for (const auto& triangle : triangles_of(type, list)) mesh.triangles.push_back(triangle);
  }
  if (!reader.good()) return cut_short();
  return mesh;
}

}  // namespace

Result<std::vector<std::uint8_t>> encode_mshp(const Raymesh& mesh) {
  std::map<std::uint32_t, std::uint32_t> known;  // index of each float, by its bits
  std::vector<std::uint32_t> coordinates;
  std::vector<std::array<std::uint32_t, 5>> vertices;
  for (std::uint32_t k = 0; k < mesh.vertices.size(); ++k) {
    const std::array<double, 5> numbers = numbers_of(mesh, k);
    std::array<std::uint32_t, 5> indices{};
    for (std::size_t n = 0; n < 5; ++n) {
      const auto bits = std::bit_cast<std::uint32_t>(static_cast<float>(numbers[n]) + 0.0F);  // -0 is 0
      const auto [found, fresh] = known.emplace(bits, static_cast<std::uint32_t>(coordinates.size()));
      if (fresh) coordinates.push_back(bits);
      indices[n] = found->second;
    }
    vertices.push_back(indices);
  }
  if (coordinates.size() > kMaxCoordinates || vertices.size() > kMaxVertices ||
      3 * mesh.triangles.size() > kMaxIndices) {
    return fail(Errc::kTooLarge, fmt::format("the mesh has {} different coordinates, {} vertices and {} indices, and "
                                             "players take 10000, 32000 and 128000: allow a larger error",
                                             coordinates.size(), vertices.size(), 3 * mesh.triangles.size()));
  }
  BitWriter writer;
  writer.put(coordinates.size(), 32);
  for (const std::uint32_t bits : coordinates) writer.put(bits, 32);
  writer.put(vertices.size(), 32);
  const int coordinate_bits = bits_for(static_cast<std::uint32_t>(coordinates.size()));
  std::array<std::uint32_t, 5> last{};
  for (const std::array<std::uint32_t, 5>& vertex : vertices) {
    for (std::size_t n = 0; n < 5; ++n)
      writer.put_difference(std::int64_t{vertex[n]} - std::int64_t{last[n]}, coordinate_bits);
    last = vertex;
  }
  writer.align();
  writer.put(1, 32);
  writer.put(0, 8);  // the texture
  writer.put(0, 8);  // triangles
  writer.put(3 * mesh.triangles.size(), 32);
  const int vertex_bits = bits_for(static_cast<std::uint32_t>(vertices.size()));
  std::uint32_t before = 0;
  for (const Raymesh::Triangle& triangle : mesh.triangles) {
    for (const std::uint32_t vertex : triangle) {
      writer.put_difference(std::int64_t{vertex} - std::int64_t{before}, vertex_bits);
      before = vertex;
    }
  }
  writer.align();
  BitWriter rest;
  rest.put_name("raw ");
  rest.put_all(box("mesh", writer.bytes()));
  BitWriter payload;
  payload.put(0, 32);  // version and flags
  payload.put(crc32(0, rest.bytes().data(), static_cast<uInt>(rest.bytes().size())), 32);
  payload.put_all(rest.bytes());
  return box("mshp", payload.bytes());
}

Result<FileMesh> decode_mshp(std::span<const std::uint8_t> bytes) {
  BitReader reader(bytes);
  const std::uint32_t size = reader.get(32), name = reader.get(32), version = reader.get(32);
  reader.get(32);  // a CRC, of a polynomial that the specification does not name: players do not check it
  const std::uint32_t coding = reader.get(32);
  if (!reader.good() || name != 0x6D73'6870 || size != bytes.size())
    return fail(Errc::kBadFormat, "it is not an mshp box of its own size");
  if (version != 0) return fail(Errc::kUnsupported, "it is an mshp box of another version");
  std::vector<std::uint8_t> inflated_bytes;
  std::span<const std::uint8_t> boxes = reader.rest();
  if (coding == 0x6466'6C38) {  // dfl8
    inflated_bytes = inflated(boxes);
    boxes = inflated_bytes;
  } else if (coding != 0x7261'7720) {  // raw
    return fail(Errc::kUnsupported, "its coding is neither 'raw ' nor 'dfl8'");
  }
  BitReader first(boxes);
  const std::uint32_t mesh_size = first.get(32), mesh_name = first.get(32);
  if (!first.good() || mesh_name != 0x6D65'7368 || mesh_size < 8 || mesh_size > boxes.size())
    return fail(Errc::kBadFormat, "there is no whole mesh box in it");
  return decode_mesh_box(boxes.subspan(8, mesh_size - 8));
}

}  // namespace nodal::mesh
