#include "host_tool/look/head_grid.h"

#include <algorithm>
#include <numbers>
#include <optional>

#include "protocol/base/try.h"
#include "stitch/mesh/mesh_file.h"

namespace nodal::host::look {
namespace {

constexpr int kMinCells = 96, kMaxCells = 288;  // cells along the longer side: enough for edges, and for any lens

struct Corner {
  std::optional<std::uint32_t> vertex;
  Eigen::Vector3d ray{0, 0, 1};  // by the head's axes
};

class Grid {
 public:
  Grid(const geometry::Head& head, int cells) : head_(head) {
    const int longer = std::max(head.width(), head.height());
    columns_ = std::max(1, cells * head.width() / longer);
    rows_ = std::max(1, cells * head.height() / longer);
  }
  mesh::Raymesh make() {
    for (int row = 0; row <= rows_; ++row)
      for (int column = 0; column <= columns_; ++column) corners_.push_back(corner(column, row));
    for (int row = 0; row < rows_; ++row) {
      for (int column = 0; column < columns_; ++column) {
        add(column, row, {0, 0}, {0, 1}, {1, 1});
        add(column, row, {0, 0}, {1, 1}, {1, 0});
      }
    }
    return std::move(mesh_);
  }
  double error() const { return error_; }

 private:
  using Step = std::array<int, 2>;

  geometry::Pixel pixel(double column, double row) const {
    return {column * head_.width() / columns_, row * head_.height() / rows_};
  }
  std::optional<Eigen::Vector3d> ray(const geometry::Pixel& at) const {
    const std::optional<geometry::Ray> rig = head_.unproject(at);
    if (!rig) return std::nullopt;
    return head_.R_head_rig() * head_.seen_from_here(rig->direction());
  }
  Corner corner(int column, int row) {
    const geometry::Pixel at = pixel(column, row);
    const std::optional<Eigen::Vector3d> direction = ray(at);
    if (!direction || !head_.contains(at)) return {};
    const auto number = static_cast<std::uint32_t>(mesh_.points.size());
    mesh_.points.push_back(*direction);
    mesh_.vertices.push_back({number, {static_cast<double>(column) / columns_, static_cast<double>(row) / rows_}});
    return {number, *direction};
  }
  const Corner& at(int column, int row) const {
    return corners_[static_cast<std::size_t>(row * (columns_ + 1) + column)];
  }
  void add(int column, int row, Step a, Step b, Step c) {
    mesh::Raymesh::Triangle triangle{};
    const std::array<Step, 3> steps{a, b, c};
    for (std::size_t k = 0; k < 3; ++k) {
      const Corner& one = at(column + steps[k][0], row + steps[k][1]);
      if (!one.vertex) return;
      triangle[k] = *one.vertex;
    }
    mesh_.triangles.push_back(triangle);
    for (std::size_t k = 0; k < 3; ++k) measure(column, row, steps[k], steps[(k + 1) % 3]);
  }
  /// Graphics interpolate the place in the picture evenly along an edge, whose middle the lens sees elsewhere.
  void measure(int column, int row, Step from, Step to) {
    const Eigen::Vector3d middle = (at(column + from[0], row + from[1]).ray + at(column + to[0], row + to[1]).ray) / 2;
    const auto exact = ray(pixel(column + (from[0] + to[0]) / 2.0, row + (from[1] + to[1]) / 2.0));
    if (!exact) return;
    error_ = std::max(error_, angle_between(geometry::Ray::towards(middle), geometry::Ray::towards(*exact)));
  }

  const geometry::Head& head_;
  int columns_ = 1, rows_ = 1;
  std::vector<Corner> corners_;
  mesh::Raymesh mesh_;
  double error_ = 0;  // rad
};

}  // namespace

Result<HeadGrid> grid_of(const geometry::Head& head, double max_error_deg) {
  for (int cells = kMinCells;; cells += kMinCells) {
    Grid grid(head, cells);
    const mesh::Raymesh mesh = grid.make();
    if (mesh.triangles.empty())
      return fail(Errc::kNoCoverage, "head '" + head.name() + "': its region and masks leave nothing of its picture");
    const double error_deg = grid.error() * 180 / std::numbers::pi;
    if (error_deg > max_error_deg && cells < kMaxCells) continue;
    NODAL_TRY_ASSIGN(std::vector<std::uint8_t> glb, mesh::encode_mesh(mesh, mesh::MeshFormat::kGlb, ""));
    return HeadGrid{std::move(glb), error_deg};
  }
}

}  // namespace nodal::host::look
