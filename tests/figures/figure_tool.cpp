// Draws what the figures of the paper show beside the raymaps themselves; tests/figures/run uses it.
#include <CLI/CLI.hpp>
#include <Eigen/Core>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <numbers>
#include <optional>
#include <random>
#include <sstream>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "stitch/geometry/head.h"
#include "stitch/media/image_file.h"
#include "stitch/media/png_writer.h"
#include "stitch/mesh/mesh_file.h"
#include "stitch/parallel/workers.h"
#include "stitch/view/resampler.h"
#include "tests/reference/discrepancy.h"

namespace nodal::figures {
namespace {

using geometry::Ray;
using geometry::RaymapLayout;

template <class T>
T must(Result<T> result) {
  if (!result) throw std::runtime_error(result.error().text());
  return std::move(*result);
}

/// RGB24.
struct Canvas {
  DecodedImage image;

  static Canvas blank(int width, int height) {
    DecodedImage image{PixelFormat::kRgb24, width, height, {}};
    image.bytes.assign(packed_size(image.format, width, height), 255);
    return {image};
  }
  void paint(int x, int y, std::uint8_t r, std::uint8_t g, std::uint8_t b) {
    if (x < 0 || y < 0 || x >= image.width || y >= image.height) return;
    std::uint8_t* at = image.bytes.data() + 3 * (static_cast<std::ptrdiff_t>(y) * image.width + x);
    at[0] = r, at[1] = g, at[2] = b;
  }
  void put(const DecodedImage& other, int left, int top) {
    for (int y = 0; y < other.height; ++y) {
      for (int x = 0; x < other.width; ++x) {
        const std::uint8_t* from = other.bytes.data() + 3 * (static_cast<std::ptrdiff_t>(y) * other.width + x);
        paint(left + x, top + y, from[0], from[1], from[2]);
      }
    }
  }
  void write(const std::string& file) const {
    const auto png = must(media::png_file({image.width, image.height, 3, 8, image.bytes}, {}));
    std::ofstream out(file, std::ios::binary);
    out.write(reinterpret_cast<const char*>(png.data()), static_cast<std::streamsize>(png.size()));
    if (!out.flush()) throw std::runtime_error("cannot write " + file);
  }
};

/// Figure 4: red where the field of a head begins.
void borders(const std::string& rig, const std::string& raymap, const std::string& layout_name,
             const std::string& out) {
  std::ifstream in(rig, std::ios::binary);
  std::ostringstream text;
  text << in.rdbuf();
  const std::vector<geometry::Head> heads = must(geometry::make_heads(must(parse_calibration(text.str()))));
  Canvas canvas{must(media::read_image(raymap, PixelFormat::kRgb24))};
  const int width = canvas.image.width, height = canvas.image.height;
  const auto layout = must(geometry::make_layout(layout_name, width, height));
  // A bit for each head that sees the pixel's ray; the last bit: there is a ray.
  std::vector<std::uint32_t> seen(static_cast<std::size_t>(width) * static_cast<std::size_t>(height), 0);
  const auto at = [&](int x, int y) -> std::uint32_t& {
    return seen[static_cast<std::size_t>(y) * static_cast<std::size_t>(width) + static_cast<std::size_t>(x)];
  };
  parallel::Workers(0).run(height, [&](int y) {
    for (int x = 0; x < width; ++x) {
      const auto ray = layout->ray(x + 0.5, y + 0.5);
      if (!ray) continue;
      at(x, y) = 1U << 31;
      for (std::size_t h = 0; h < heads.size(); ++h) {
        const auto pixel = heads[h].project(*ray);
        if (pixel && heads[h].contains(*pixel)) at(x, y) |= 1U << h;
      }
    }
  });
  const auto near = [&](int x, int y, int u, int v) {
    const auto a = layout->ray(x + 0.5, y + 0.5), b = layout->ray(u + 0.5, v + 0.5);
    return a && b && geometry::angle_between(*a, *b) < 8 * std::sqrt(4 * std::numbers::pi / width / height);
  };
  const int thick = std::max(1, width / 500);
  for (int y = 0; y + 1 < height; ++y) {
    for (int x = 0; x + 1 < width; ++x) {
      const bool border =
          (at(x, y) != at(x + 1, y) && near(x, y, x + 1, y)) || (at(x, y) != at(x, y + 1) && near(x, y, x, y + 1));
      for (int k = 0; border && k < thick * thick; ++k) canvas.paint(x + k % thick, y + k / thick, 255, 0, 0);
    }
  }
  canvas.write(out);
}

/// Figure 6: the points of the front half of a sphere; left independent random ones, right the first Hammersley points.
void points(const std::string& out, int count) {
  constexpr int kSide = 900;
  std::mt19937 random(1);
  std::normal_distribution<double> normal;
  const auto layout = must(geometry::make_layout("hammersley", count, 1));
  std::vector<Eigen::Vector3d> independent, hammersley;
  for (int k = 0; k < count; ++k) {
    independent.push_back(Eigen::Vector3d(normal(random), normal(random), normal(random)).normalized());
    hammersley.push_back(layout->ray(k + 0.5, 0.5)->direction());
  }
  Canvas canvas = Canvas::blank(2 * kSide, kSide);
  int left = 0;
  for (const auto* drawn : {&independent, &hammersley}) {
    for (const Eigen::Vector3d& point : *drawn) {
      if (point.z() < 0) continue;
      const int x = left + static_cast<int>(kSide * (0.5 + 0.48 * point.x()));
      const int y = static_cast<int>(kSide * (0.5 + 0.48 * point.y()));
      for (int k = 0; k < 9; ++k) canvas.paint(x + k % 3 - 1, y + k / 3 - 1, 0, 0, 0);
    }
    left += kSide;
  }
  canvas.write(out);
  std::printf("discrepancy of %d points: independent %.6f (on average %.6f), Hammersley %.6f\n", count,
              std::sqrt(test::squared_discrepancy(independent)), std::sqrt(1 / (3.0 * count)),
              std::sqrt(test::squared_discrepancy(hammersley)));
}

/// The icosahedron of the layout of that name; its faces touch the unit sphere.
class Icosahedron {
 public:
  Icosahedron() {
    std::vector<Eigen::Vector3d> corners{{0, -1, 0}, {0, 1, 0}};
    for (int k = 0; k < 5; ++k) {
      const double turn = 2 * std::numbers::pi / 5;
      corners.push_back(Ray::at(geometry::Angles{(k - 2) * turn, -std::atan(0.5)}).direction());
      corners.push_back(Ray::at(geometry::Angles{(k - 1.5) * turn, std::atan(0.5)}).direction());
    }
    const auto joined = [&](std::size_t a, std::size_t b) {
      return std::abs(corners[a].dot(corners[b]) - std::sqrt(0.2)) < 1e-9;
    };
    for (std::size_t a = 0; a < 12; ++a) {
      for (std::size_t b = 0; b < a; ++b) {
        for (std::size_t c = 0; c < b; ++c) {
          if (joined(a, b) && joined(b, c) && joined(a, c))
            normals_.push_back((corners[a] + corners[b] + corners[c]).normalized());
        }
      }
    }
  }
  /// Where a line from outside meets the surface first.
  std::optional<Eigen::Vector3d> hit(const Eigen::Vector3d& from, const Eigen::Vector3d& along) const {
    double enters = -1e9, leaves = 1e9;
    for (const Eigen::Vector3d& n : normals_) {
      const double t = (1 - n.dot(from)) / n.dot(along);
      (n.dot(along) < 0 ? enters : leaves) = n.dot(along) < 0 ? std::max(enters, t) : std::min(leaves, t);
    }
    if (enters > leaves) return std::nullopt;
    return from + enters * along;
  }
  /// How far a point of the surface is from an edge.
  double from_edge(const Eigen::Vector3d& point) const {
    double first = -1e9, second = -1e9;
    for (const Eigen::Vector3d& n : normals_) {
      const double d = n.dot(point);
      if (d > first) second = std::exchange(first, d);
      else second = std::max(second, d);
    }
    return (first - second) / first;
  }

 private:
  std::vector<Eigen::Vector3d> normals_;
};

/// Figure 5: an envelope, an icosahedron seen from outside, and its raymap, with the mesh in both.
void raymesh(const std::string& sphere, const std::string& out) {
  constexpr int kSide = 760, kMapWidth = 1200;
  constexpr double kEdge = 0.006;
  const parallel::Workers workers(0);
  const DecodedImage picture = must(media::read_image(sphere, PixelFormat::kRgb24));
  const auto from = must(geometry::make_layout("equirectangular", picture.width, picture.height));
  const view::Resampler resampler(*from, view::Filter::kBicubic, workers);
  const Icosahedron envelope;
  const Eigen::Vector3d look = Eigen::Vector3d(0.35, 0.3, 1).normalized();
  const Eigen::Vector3d right = Eigen::Vector3d(look.z(), 0, -look.x()).normalized(), down = look.cross(right);
  const auto hit = [&](double x, double y) {
    const double u = 2.7 * (x / kSide - 0.5), v = 2.7 * (y / kSide - 0.5);
    return envelope.hit(u * right + v * down - 4 * look, look);
  };
  const auto outside = [&](double x, double y) -> std::optional<Ray> {
    const auto point = hit(x, y);
    return point ? std::optional(Ray::towards(*point)) : std::nullopt;
  };
  const view::Target seen{kSide, kSide, outside, 0, false};
  const geometry::RaymapSize size = must(geometry::LayoutName::parse("icosahedron")).size_for_width(kMapWidth);
  const auto layout = must(geometry::make_layout("icosahedron", size.width, size.height));
  Canvas canvas = Canvas::blank(kSide + size.width + 20, kSide);
  const int top = (kSide - size.height) / 2;
  canvas.put(resampler.resample(picture.view(), seen, workers), 0, 0);
  canvas.put(resampler.resample(picture.view(), view::Target::of(*layout), workers), kSide + 20, top);
  for (int y = 0; y < kSide; ++y) {
    for (int x = 0; x < kSide; ++x) {
      const auto point = hit(x + 0.5, y + 0.5);
      if (!point) canvas.paint(x, y, 255, 255, 255);
      if (point && envelope.from_edge(*point) < kEdge) canvas.paint(x, y, 255, 255, 0);
    }
  }
  for (int y = 0; y < size.height; ++y) {
    for (int x = 0; x < size.width; ++x) {
      const auto ray = layout->ray(x + 0.5, y + 0.5);
      if (ray && envelope.from_edge(ray->direction()) < kEdge) canvas.paint(kSide + 20 + x, top + y, 255, 255, 0);
    }
  }
  canvas.write(out);
}

/// The edges of a raymesh's triangles in its raymap, yellow. To the right of the right edge goes on at the left.
void wireframe(const std::string& raymap, const std::string& mesh_file, const std::string& out) {
  const mesh::MeshFormat format = must(mesh::mesh_format_of_name(mesh_file));
  std::ifstream in(mesh_file, std::ios::binary);
  const std::vector<std::uint8_t> bytes{std::istreambuf_iterator<char>(in), {}};
  const mesh::Raymesh mesh = must(mesh::decode_mesh(bytes, format));
  Canvas canvas{must(media::read_image(raymap, PixelFormat::kRgb24))};
  const int width = canvas.image.width, height = canvas.image.height;
  const Eigen::Vector2d size(width, height);
  for (const auto& triangle : mesh.triangles) {
    for (std::size_t k = 0; k < 3; ++k) {
      const Eigen::Vector2d from = mesh.vertices[triangle[k]].texture.cwiseProduct(size);
      const Eigen::Vector2d to = mesh.vertices[triangle[(k + 1) % 3]].texture.cwiseProduct(size);
      const int steps = 1 + static_cast<int>(2 * (to - from).norm());
      for (int step = 0; step <= steps; ++step) {
        const Eigen::Vector2d at = from + (to - from) * step / steps;
        const int x = static_cast<int>(std::floor(at.x())), y = std::min(static_cast<int>(at.y()), height - 1);
        canvas.paint((x % width + width) % width, y, 255, 255, 0);
      }
    }
  }
  canvas.write(out);
}

}  // namespace
}  // namespace nodal::figures

int main(int argc, char** argv) {
  CLI::App app{"Draws what the figures of the paper show beside the raymaps themselves"};
  app.require_subcommand(1);
  std::string rig, raymap, layout, mesh_file, out;
  int count = 10000;
  CLI::App* bordered = app.add_subcommand("borders", "Figure 4: the heads' fields, outlined in red");
  bordered->add_option("RIG", rig)->required();
  bordered->add_option("RAYMAP", raymap)->required();
  bordered->add_option("LAYOUT", layout)->required();
  bordered->add_option("OUT", out)->required();
  CLI::App* mesh = app.add_subcommand("raymesh", "Figure 5: an envelope and its raymap");
  mesh->add_option("SPHERE", raymap, "equirectangular")->required();
  mesh->add_option("OUT", out)->required();
  CLI::App* dots = app.add_subcommand("points", "Figure 6: random and Hammersley points");
  dots->add_option("OUT", out)->required();
  dots->add_option("--count", count)->check(CLI::Range(1, 30000));
  CLI::App* wires = app.add_subcommand("wireframe", "A raymesh over its raymap");
  wires->add_option("RAYMAP", raymap)->required();
  wires->add_option("MESH", mesh_file)->required();
  wires->add_option("OUT", out)->required();
  CLI11_PARSE(app, argc, argv);
  try {
    if (*bordered) nodal::figures::borders(rig, raymap, layout, out);
    if (*mesh) nodal::figures::raymesh(raymap, out);
    if (*wires) nodal::figures::wireframe(raymap, mesh_file, out);
    if (*dots) nodal::figures::points(out, count);
  } catch (const std::exception& wrong) {
    std::fprintf(stderr, "figure_tool: %s\n", wrong.what());
    return 1;
  }
}
