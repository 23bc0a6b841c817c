// Rows of files that rigs and hosts read: lists of rays, meshes, pictures, point pairs.
#include <gtest/gtest.h>

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <string>

#include "heap.h"
#include "host_tool/input/pairs_file.h"
#include "protocol/base/limits.h"
#include "rows.h"
#include "stitch/geometry/envelope/envelope.h"
#include "stitch/geometry/raymap/ray_list.h"
#include "stitch/media/png_meaning.h"
#include "stitch/media/tiff/exif_block.h"
#include "stitch/media/xmp/xmp.h"
#include "stitch/mesh/mesh_file.h"
#include "stitch/mesh/raymesh.h"
#include "stitch/registration/pairs.h"

namespace nodal::limits {
namespace {

/// As many rays as there may be, each another one.
std::string rays_file() {
  constexpr int kWidth = 2048, kHeight = static_cast<int>(geometry::kMaxRays) / kWidth;
  std::string text = fmt::format("rays {} {}\n", kWidth, kHeight);
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) text += fmt::format("{} {} 4096\n", x, y);
  }
  return text;
}

/// A sphere of 2 * columns * (rows - 1) triangles.
mesh::Raymesh sphere(int columns, int rows) {
  mesh::Raymesh mesh;
  for (int row = 0; row <= rows; ++row) {
    for (int column = 0; column < columns; ++column) {
      if ((row == 0 || row == rows) && column > 0) continue;
      const double polar = M_PI * row / rows, around = 2 * M_PI * column / columns;
      mesh.vertices.push_back({static_cast<std::uint32_t>(mesh.points.size()), {0.5, 0.5}});
      mesh.points.emplace_back(std::sin(polar) * std::cos(around), std::cos(polar), std::sin(polar) * std::sin(around));
    }
  }
  const auto vertex = [&](int row, int column) {
    if (row == 0) return std::uint32_t{0};
    return static_cast<std::uint32_t>(row == rows ? 1 + (rows - 1) * columns
                                                  : 1 + (row - 1) * columns + column % columns);
  };
  for (int row = 0; row < rows; ++row) {
    for (int column = 0; column < columns; ++column) {
      const std::uint32_t a = vertex(row, column), b = vertex(row, column + 1), c = vertex(row + 1, column),
                          d = vertex(row + 1, column + 1);
      if (row > 0) mesh.triangles.push_back({a, b, d});
      if (row + 1 < rows) mesh.triangles.push_back({a, d, c});
    }
  }
  return mesh;
}

/// The largest mesh with places. MSHP has fewer triangles.
std::uint64_t of_a_mesh(mesh::MeshFormat format) {
  const auto bytes = mesh::encode_mesh(sphere(512, 257), format, "").value();
  return peak_of([&] {
    const auto read = mesh::decode_mesh(bytes, format);
    ASSERT_TRUE(read) << read.error().text();
    EXPECT_EQ(read->triangles.size(), mesh::kMaxMeshTriangles);
  });
}

std::string filled_xmp(const std::string& part) {
  std::string text =
      "<x:xmpmeta xmlns:x=\"adobe:ns:meta/\"><rdf:RDF xmlns:rdf=\"http://www.w3.org/1999/02/22-rdf-syntax-ns#\">";
  while (text.size() + part.size() <= media::kMaxXmpBytes) text += part;
  return text;
}

TEST(LimitsOfMemory, OfFilesThatHostsAndRigsRead_AreThoseOnThePage) {
  check({
      {"a list of rays", Means::kHeap,
       [] {
         const std::string text = rays_file();
         return peak_of([&] { EXPECT_TRUE(geometry::parse_ray_list(text)); });
       }},
      {"a mesh of an envelope", Means::kHeap,
       [] {
         const auto bytes = mesh::encode_mesh(sphere(64, 33), mesh::MeshFormat::kObj, "").value();
         const std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
         return peak_of([&] { EXPECT_TRUE(geometry::Envelope::from_obj(text)); });
       }},
      {"a mesh with places in a raymap", Means::kHeap,
       [] { return std::max(of_a_mesh(mesh::MeshFormat::kObj), of_a_mesh(mesh::MeshFormat::kGlb)); }},
      {"a picture to replay", Means::kSizes, [] { return kMaxPicturePixels * 6; }},  // three samples of 16 bits
      {"chunks of a PNG: profile, texts, Exif", Means::kSizes,
       [] { return std::uint64_t{media::kMaxPngTexts + 2} * media::kMaxPngChunkBytes; }},
      {"Exif of a TIFF", Means::kSizes,
       [] { return 3 * media::kMaxExifEntries * (media::kMaxExifEntryBytes + 12); }},  // three directories
      {"XMP of a picture", Means::kHeap,
       [] {
         const std::string text = filled_xmp("<a b=\"\"/>");
         return peak_of([&] { (void)media::parse_xmp(text); });
       }},
      {"point pairs of a file or project", Means::kSizes,
       [] { return 2 * host::kMaxPointPairs * sizeof(registration::PointPair); }},  // a vector that grows
  });
}

}  // namespace
}  // namespace nodal::limits
