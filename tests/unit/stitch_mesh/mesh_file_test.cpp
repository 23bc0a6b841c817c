// Mesh files: there and back, against bytes by hand, and bad ones.
#include "stitch/mesh/mesh_file.h"

#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "stitch/geometry/raymap/layout.h"
#include "stitch/mesh/of_layout.h"

namespace nodal::mesh {
namespace {

using Bytes = std::vector<std::uint8_t>;

Raymesh octahedron() {
  const auto layout = geometry::make_layout("octahedron", 64, 64).value();
  return mesh_of_layout(*layout, geometry::Envelope::named("cylinder:2,3").value(), 0.02).value().mesh;
}

TEST(MeshFile, ThereAndBack_IsTheSameMesh_InEveryFormat) {
  const Raymesh mesh = octahedron();
  for (const MeshFormat format : {MeshFormat::kObj, MeshFormat::kGlb, MeshFormat::kMshp}) {
    const Bytes bytes = encode_mesh(mesh, format, "").value();
    const Result<Raymesh> back = decode_mesh(bytes, format);
    ASSERT_TRUE(back) << back.error().text();
    ASSERT_EQ(back->triangles.size(), mesh.triangles.size());
    EXPECT_EQ(back->points.size(), mesh.points.size()) << "points are shared across seams again";
    for (std::size_t k = 0; k < mesh.triangles.size(); ++k) {
      for (std::size_t c = 0; c < 3; ++c) {
        const std::uint32_t was = mesh.triangles[k][c], is = back->triangles[k][c];
        EXPECT_LE((back->point(is) - mesh.point(was)).norm(), 1e-5);
        EXPECT_LE((back->vertices[is].texture - mesh.vertices[was].texture).norm(), 1e-6);
      }
    }
  }
}

TEST(MeshFile, AnObj_IsAlsoAnEnvelope) {
  const Bytes bytes = encode_mesh(octahedron(), MeshFormat::kObj, "").value();
  const auto envelope = geometry::Envelope::from_obj({reinterpret_cast<const char*>(bytes.data()), bytes.size()});
  ASSERT_TRUE(envelope) << envelope.error().text();
  EXPECT_NEAR(envelope->rho(geometry::Ray::towards(1, 0, 0)), 2, 1e-3);
  EXPECT_NEAR(envelope->rho(geometry::Ray::towards(0, 1, 0)), 1.5, 1e-3);
}

/// One triangle; the bits of its vertices were put together by hand from the specification.
Bytes box_by_hand() {
  return {0,    0,    0,    0x42, 'm',  's',  'h', 'p',  0,    0,    0,   0,  // version and flags
          0,    0,    0,    0,                                                // the CRC, which is not checked
          'r',  'a',  'w',  ' ',  0,    0,    0,   0x2E, 'm',  'e',  's', 'h', 0, 0, 0, 3,  // coordinates
          0,    0,    0,    0,    0x3F, 0x80, 0,   0,    0xBF, 0x80, 0,   0,                // 0, 1, -1
          0,    0,    0,    3,                                                              // vertices
          0x92, 0x00, 0x40, 0x40, 0x10, 0x10,  // 3 bits a difference: 2 2 2 0 0; 1 2 2 1 0; 1 1 2 1 1
          0,    0,    0,    1,    0,    0,    0,   0,    0,    3,  // one list, texture 0, triangles, three indices
          0x09, 0x00};                                             // 3 bits each: 0 1 2
}

TEST(MeshFile, AnMshpBoxByHand_IsReadAndWrittenAsItIs) {
  const Bytes bytes = box_by_hand();
  const Result<Raymesh> mesh = decode_mesh(bytes, MeshFormat::kMshp);
  ASSERT_TRUE(mesh) << mesh.error().text();
  ASSERT_EQ(mesh->triangles.size(), 1U);
  // The box: (-1, -1, -1) at (0, 0), (1, -1, -1) at (1, 0), (1, 1, -1) at (1, 1); y up, z backward, v from below.
  EXPECT_EQ(mesh->points, (std::vector<Eigen::Vector3d>{{-1, 1, 1}, {1, 1, 1}, {1, -1, 1}}));
  EXPECT_EQ(mesh->vertices[0].texture, Eigen::Vector2d(0, 1));
  EXPECT_EQ(mesh->vertices[2].texture, Eigen::Vector2d(1, 0));
  const Bytes written = encode_mesh(*mesh, MeshFormat::kMshp, "").value();
  // The writer's order of coordinates: -1, 0, 1. What must be equal are the lengths and what is read back.
  EXPECT_EQ(written.size(), bytes.size());
  EXPECT_EQ(decode_mesh(written, MeshFormat::kMshp)->points, mesh->points);
}

TEST(MeshFile, AGlb_IsWhatTheSpecificationAsksFor) {
  const Raymesh mesh = octahedron();
  const Bytes bytes = encode_mesh(mesh, MeshFormat::kGlb, "a map.jpg").value();
  const auto word = [&](std::size_t at) {
    return bytes[at] | bytes[at + 1] << 8 | bytes[at + 2] << 16 | static_cast<std::uint32_t>(bytes[at + 3]) << 24;
  };
  EXPECT_EQ(std::string(bytes.begin(), bytes.begin() + 4), "glTF");
  EXPECT_EQ(word(4), 2U);
  EXPECT_EQ(word(8), bytes.size());
  const std::size_t json_size = word(12);
  EXPECT_EQ(json_size % 4, 0U);
  EXPECT_EQ(std::string(bytes.begin() + 16, bytes.begin() + 20), "JSON");
  const auto root =
      nlohmann::json::parse(bytes.begin() + 20, bytes.begin() + 20 + static_cast<std::ptrdiff_t>(json_size));
  EXPECT_EQ(root["asset"]["version"], "2.0");
  EXPECT_EQ(root["images"][0]["uri"], "a%20map.jpg");
  EXPECT_TRUE(root["materials"][0]["extensions"].contains("KHR_materials_unlit"));
  EXPECT_EQ(root["extensionsUsed"], nlohmann::json::array({"KHR_materials_unlit"}));
  const std::size_t bin = 20 + json_size;
  EXPECT_EQ(word(bin), root["buffers"][0]["byteLength"]);
  EXPECT_EQ(std::string(bytes.begin() + static_cast<std::ptrdiff_t>(bin) + 4,
                        bytes.begin() + static_cast<std::ptrdiff_t>(bin) + 7),
            "BIN");
  EXPECT_EQ(bytes.size(), bin + 8 + word(bin));
  std::size_t end = 0;
  for (const auto& view : root["bufferViews"]) {
    EXPECT_EQ(view["byteOffset"].get<std::size_t>(), end) << "views follow each other";
    EXPECT_EQ(view["byteOffset"].get<std::size_t>() % 4, 0U);
    end += view["byteLength"].get<std::size_t>();
  }
  EXPECT_EQ(end, word(bin));
  EXPECT_EQ(root["accessors"][2]["count"], 3 * mesh.triangles.size());
  for (std::size_t k = 0; k < 3; ++k) {
    // A cylinder of radius 2 and height 3, up along y.
    EXPECT_NEAR(root["accessors"][0]["max"][k].get<double>(), k == 1 ? 1.5 : 2, 1e-6);
    EXPECT_NEAR(root["accessors"][0]["min"][k].get<double>(), k == 1 ? -1.5 : -2, 1e-6);
  }
}

/// A .glb by hand: its JSON, and its buffer.
Bytes glb(const nlohmann::json& root, const std::vector<float>& numbers) {
  std::string json = root.dump();
  json.resize((json.size() + 3) / 4 * 4, ' ');
  Bytes bytes;
  const auto put = [&](std::size_t word) {
    for (int k = 0; k < 4; ++k) bytes.push_back(static_cast<std::uint8_t>(word >> (8 * k)));
  };
  const std::size_t size = 4 * numbers.size();
  for (const std::size_t word :
       {std::size_t{0x46546C67}, std::size_t{2}, 28 + json.size() + size, json.size(), std::size_t{0x4E4F534A}})
    put(word);
  bytes.insert(bytes.end(), json.begin(), json.end());
  put(size);
  put(0x004E4942);
  for (const float number : numbers) put(std::bit_cast<std::uint32_t>(number));
  return bytes;
}

/// A hall as modellers write them: one wall, a square of side 2 in the plane z = 0, stands at six places. No texture
/// coordinates, no indices. `parent` is the node that holds all walls.
nlohmann::json hall(const nlohmann::json& parent) {
  const double h = std::sqrt(0.5);
  nlohmann::json nodes = nlohmann::json::array({parent});
  const auto wall = [&](const nlohmann::json& translation, const nlohmann::json& rotation) {
    nodes[0]["children"].push_back(nodes.size());
    nodes.push_back({{"mesh", 0}, {"translation", translation}, {"rotation", rotation}});
  };
  wall({0, 0, -1}, {0, 0, 0, 1});
  wall({0, 0, 1}, {0, 1, 0, 0});
  wall({1, 0, 0}, {0, -h, 0, h});
  wall({-1, 0, 0}, {0, h, 0, h});
  wall({0, 1, 0}, {h, 0, 0, h});
  wall({0, -1, 0}, {-h, 0, 0, h});
  return {{"asset", {{"version", "2.0"}}},
          {"scene", 0},
          {"scenes", {{{"nodes", {0}}}}},
          {"nodes", nodes},
          {"meshes", {{{"primitives", {{{"attributes", {{"POSITION", 0}}}}}}}}},
          {"accessors", {{{"bufferView", 0}, {"componentType", 5126}, {"count", 6}, {"type", "VEC3"}}}},
          {"bufferViews", {{{"buffer", 0}, {"byteLength", 72}}}},
          {"buffers", {{{"byteLength", 72}}}}};
}
const std::vector<float> kWall{-1, -1, 0, 1, -1, 0, 1, 1, 0, -1, -1, 0, 1, 1, 0, -1, 1, 0};

TEST(MeshFile, AGlbOfSeveralNodes_IsAnEnvelope) {
  // Twice as high (y), moved by 0.25 upwards: 1.75 m below the nodal point, 2.25 m above it; mirrored, too.
  for (const double across : {3, -3}) {
    const auto envelope = decode_envelope(glb(hall({{"scale", {across, 2, 4}}, {"translation", {0, 0.25, 0}}}), kWall));
    ASSERT_TRUE(envelope) << envelope.error().text();
    EXPECT_NEAR(envelope->rho(geometry::Ray::towards(1, 0, 0)), 3, 1e-6);
    EXPECT_NEAR(envelope->rho(geometry::Ray::towards(0, 1, 0)), 1.75, 1e-6);
    EXPECT_NEAR(envelope->rho(geometry::Ray::towards(0, -1, 0)), 2.25, 1e-6);
    EXPECT_NEAR(envelope->rho(geometry::Ray::towards(0, 0, 1)), 4, 1e-6);
  }
  const auto matrix = nlohmann::json::parse("[3,0,0,0, 0,2,0,0, 0,0,4,0, 0,0,0.5,1]");
  const auto moved = decode_envelope(glb(hall({{"matrix", matrix}}), kWall));
  ASSERT_TRUE(moved) << moved.error().text();
  EXPECT_NEAR(moved->rho(geometry::Ray::towards(0, 0, 1)), 3.5, 1e-6) << "z is backward in glTF";
}

void expect_no_envelope(const nlohmann::json& root, Errc code, const std::string& says) {
  const auto envelope = decode_envelope(glb(root, kWall));
  ASSERT_FALSE(envelope) << says;
  EXPECT_EQ(envelope.error().code, code) << says;
  EXPECT_NE(envelope.error().message.find(says), std::string::npos) << envelope.error().message;
}

TEST(MeshFile, BadScenes_AreOneError) {
  using Json = nlohmann::json;
  const Json good = hall(Json::object());
  const auto with = [&](const char* pointer, const Json& value) {
    Json root = good;
    root[Json::json_pointer(pointer)] = value;
    return root;
  };
  expect_no_envelope(with("/nodes/3/mesh", 7), Errc::kBadFormat, "a mesh that is not there");
  expect_no_envelope(with("/nodes/0/children/2", 70), Errc::kBadFormat, "a node that is not there: 70");
  expect_no_envelope(with("/nodes/0/children/2", 1), Errc::kBadValue, "triangle 5: the face folds over");
  expect_no_envelope(with("/nodes/0/children", {1, 2, 3, 4, 5}), Errc::kBadValue, "a hole");
  expect_no_envelope(with("/nodes/0/translation", {0, 5, 0}), Errc::kBadValue, "the face of triangle");
  expect_no_envelope(with("/nodes/0/translation", {0, 1e300, 0}), Errc::kBadFormat,
                     "nodes[0]: its matrix, translation");
  expect_no_envelope(with("/nodes/0/scale", {0, 1, 1}), Errc::kBadValue, "");
  expect_no_envelope(with("/nodes/0/scale", {0, 0, 0}), Errc::kBadValue, "at the nodal point");
  expect_no_envelope(with("/nodes/2/rotation", {0, 0, 0, 0}), Errc::kBadFormat, "nodes[2]: its rotation");
  expect_no_envelope(with("/nodes/2/children", {0}), Errc::kBadFormat, "nested deeper");
  expect_no_envelope(with("/nodes/2/children", 3), Errc::kBadFormat, "no lists");
  expect_no_envelope(with("/scenes/0/nodes", Json::array()), Errc::kBadFormat, "no triangle");
  expect_no_envelope(with("/meshes/0/primitives/0/mode", 5), Errc::kUnsupported, "meshes[0].primitives[0]: it is not");
  expect_no_envelope(with("/meshes/0/primitives/0/attributes", {{"NORMAL", 0}}), Errc::kMissingField, "POSITION");
  expect_no_envelope(with("/accessors/0/count", 7), Errc::kTruncated, "beyond its buffer");
  expect_no_envelope(with("/accessors/0/count", 5), Errc::kBadFormat, "not three a triangle");
  // Each node has two children that are the next one, so that the last would be there 2^40 times.
  Json many = good;
  for (int k = 0; k < 40; ++k) many["nodes"][static_cast<std::size_t>(k)] = {{"children", {k + 1, k + 1}}};
  many["nodes"][40] = {{"mesh", 0}};
  expect_no_envelope(many, Errc::kTooLarge, "4096 nodes and primitives");
}

void expect_refused(Bytes bytes, MeshFormat format, const std::string& says) {
  const Result<Raymesh> mesh = decode_mesh(bytes, format);
  ASSERT_FALSE(mesh) << says;
  EXPECT_NE(mesh.error().message.find(says), std::string::npos) << mesh.error().message;
}

Bytes text(const std::string& of) { return {of.begin(), of.end()}; }

TEST(MeshFile, BadFiles_AreRefusedWithWhereAndWhy) {
  for (const MeshFormat format : {MeshFormat::kGlb, MeshFormat::kMshp}) {
    const Bytes good = encode_mesh(octahedron(), format, "").value();
    for (std::size_t size = 0; size < good.size(); size += 1 + good.size() / 60)
      EXPECT_FALSE(decode_mesh(std::span(good).first(size), format)) << "cut after " << size;
  }
  expect_refused(text("v 0 0 1\nv 1 0 1\nv 0 1 1\nf 1 2 3\n"), MeshFormat::kObj, "line 4: the face has no texture");
  expect_refused(text("v 0 0 1\nvt 0 nan\n"), MeshFormat::kObj, "line 2: after vt");
  expect_refused(text("v 0 0 1\nvt 0 0\nf 1/1 1/2 1/1\n"), MeshFormat::kObj,
                 "line 3: '1/2' names none of the 1 texture");
  expect_refused(text("v 0 0 0\nvt 0 0\nf 1/1 1/1 1/1\n"), MeshFormat::kObj, "nodal point");
  expect_refused(text("v 0 0 1\nvt 0 2000\nf 1/1 1/1 1/1\n"), MeshFormat::kObj, "vertex 1");
  expect_refused(text("v 0 0 1\nv 1 0 1\nv 0 1 1\nvt 0 0\nf 1/1 2/1 3/1\nf 1/1 2/1 3/1\n"), MeshFormat::kObj,
                 "triangle 2 folds over, or runs around the other way than, triangle 1");
  expect_refused(text("v 0 0 1\nv 1 0 1\nv 0 0 3\nvt 0 0\nf 1/1 2/1 3/1\n"), MeshFormat::kObj, "triangle 1 is seen");
  std::string many = "v 0 0 1\nvt 0 0\nf";
  for (std::size_t k = 0; k < kMaxMeshTriangles + 3; ++k) many += " 1/1";
  expect_refused(text(many + "\n"), MeshFormat::kObj, "more than 262144 triangles");
  expect_refused(Bytes(kMaxMeshFileBytes + 1), MeshFormat::kGlb, "bytes");
  expect_refused(text("\xFF\xD8\xFF\xE0 a JPEG, and no mesh"), MeshFormat::kGlb, "no binary glTF");
  expect_refused(text("\xFF\xD8\xFF\xE0 a JPEG, and no mesh"), MeshFormat::kMshp, "not an mshp box");
  Bytes far = box_by_hand();
  far[far.size() - 2] = 0x0F;  // the indices 0, -2
  expect_refused(far, MeshFormat::kMshp, "names a vertex that is not there");
  EXPECT_FALSE(mesh_format_of_name("mesh.stl"));
}

TEST(MeshFile, MeshesThatPlayersDoNotTake_AreRefusedAsMshp) {
  const auto layout = geometry::make_layout("hammersley", 256, 130).value();
  const Raymesh mesh = mesh_of_layout(*layout, geometry::Envelope::named("sphere:1").value(), 1).value().mesh;
  const auto bytes = encode_mesh(mesh, MeshFormat::kMshp, "");
  ASSERT_FALSE(bytes);
  EXPECT_NE(bytes.error().message.find("33280 vertices"), std::string::npos) << bytes.error().message;
}

}  // namespace
}  // namespace nodal::mesh
