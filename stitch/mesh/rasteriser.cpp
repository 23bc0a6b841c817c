#include "stitch/mesh/rasteriser.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "protocol/base/angles.h"
#include "protocol/base/try.h"
#include "stitch/geometry/rotation.h"
#include "stitch/view/sample.h"

namespace nodal::mesh {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

/// A triangle before the camera. An edge's function, p x q . d, is linear in the direction d = (a, b, 1) of a pixel,
/// and exactly opposite for the triangle on its other side, so that no pixel is between two. The three, divided by
/// their sum, are the weights of the corners, in perspective (Olano and Greer 1997); nothing needs to be clipped.
struct Drawn {
  std::array<Vector3d, 3> edges;  ///< opposite of each corner
  double depth = 0;               ///< depth of the plane times the sum of `edges`
  int left = 0, right = 0, top = 0, bottom = 0;
};

/// The pixels that a triangle can reach: all if a part of it is behind the camera.
void bound(const std::array<Vector3d, 3>& corners, double focal, int width, int height, Drawn& drawn) {
  drawn.right = width, drawn.bottom = height;
  constexpr double kNear = 1e-9;
  if (std::ranges::any_of(corners, [](const Vector3d& p) { return p.z() <= kNear * p.norm(); })) return;
  double x0 = width, x1 = 0, y0 = height, y1 = 0;
  for (const Vector3d& p : corners) {
    const double x = 0.5 * width + focal * p.x() / p.z(), y = 0.5 * height + focal * p.y() / p.z();
    x0 = std::min(x0, x), x1 = std::max(x1, x), y0 = std::min(y0, y), y1 = std::max(y1, y);
  }
  const auto pixel = [](double at, int most) { return static_cast<int>(std::clamp<double>(at, 0, most)); };
  drawn.left = pixel(x0 - 1, width), drawn.right = pixel(x1 + 2, width);
  drawn.top = pixel(y0 - 1, height), drawn.bottom = pixel(y1 + 2, height);
}

/// Adds a raymap's value at a place, as a part of its width and height, bilinearly.
template <class Sample>
void add_texture(const ImageView& raymap, int channels, const Vector2d& texture, double weight,
                 std::array<double, 3>& sum) {
  const double x = (texture.x() - std::floor(texture.x())) * raymap.width - 0.5;
  const double y = std::clamp(texture.y(), 0.0, 1.0) * raymap.height - 0.5;
  const double left = std::floor(x), top = std::floor(y);
  for (int k = 0; k < 4; ++k) {
    const int dx = k % 2, dy = k / 2;
    const int i = (static_cast<int>(left) + dx + raymap.width) % raymap.width;
    const int j = std::clamp(static_cast<int>(top) + dy, 0, raymap.height - 1);
    const double share = (dx == 0 ? 1 - (x - left) : x - left) * (dy == 0 ? 1 - (y - top) : y - top);
    const PlaneView& plane = raymap.planes[0];
    const std::uint8_t* at = plane.data + j * plane.row_stride + i * plane.pixel_stride;
    for (std::size_t c = 0; c < static_cast<std::size_t>(channels); ++c) {
      sum[c] += weight * share * view::load<Sample>(at + c * sizeof(Sample));
    }
  }
}

}  // namespace

Result<MeshView> MeshView::make(const Raymesh& mesh, const view::CameraSpec& spec, const Vector3d& eye,
                                const parallel::Workers& workers) {
  if (spec.name.projection != view::Projection::kPerspective)
    return fail(Errc::kUnsupported, "triangles have straight edges: only the perspective camera shows them so");
  NODAL_TRY(view::Camera::make(spec));
  MeshView made(mesh, spec.width, spec.height);
  const double focal = 0.5 * spec.width / std::tan(spec.fov_deg * kPi / 360);
  const Eigen::Matrix3d R_camera_rig = geometry::to_R_head_rig(spec.pose);
  std::vector<Drawn> triangles;
  triangles.reserve(mesh.triangles.size());
  for (const Raymesh::Triangle& t : mesh.triangles) {
    std::array<Vector3d, 3> corners;
    for (std::size_t k = 0; k < 3; ++k) corners[k] = R_camera_rig * (mesh.point(t[k]) - eye);
    Drawn drawn;
    for (std::size_t k = 0; k < 3; ++k) drawn.edges[k] = corners[(k + 1) % 3].cross(corners[(k + 2) % 3]);
    drawn.depth = corners[0].dot(drawn.edges[0]);
    bound(corners, focal, spec.width, spec.height, drawn);
    triangles.push_back(drawn);
  }
  constexpr int kRows = 16;
  workers.run((spec.height + kRows - 1) / kRows, [&](int band) {
    const int from = band * kRows, to = std::min(from + kRows, spec.height);
    std::vector<double> nearest(static_cast<std::size_t>(spec.width) * kRows, std::numeric_limits<double>::infinity());
    for (std::uint32_t k = 0; k < triangles.size(); ++k) {
      const Drawn& drawn = triangles[k];
      for (int y = std::max(from, drawn.top); y < std::min(to, drawn.bottom); ++y) {
        for (int x = drawn.left; x < drawn.right; ++x) {
          const Vector3d d((x + 0.5 - 0.5 * spec.width) / focal, (y + 0.5 - 0.5 * spec.height) / focal, 1);
          const double a = drawn.edges[0].dot(d), b = drawn.edges[1].dot(d), c = drawn.edges[2].dot(d);
          const double sum = a + b + c, z = drawn.depth / sum;
          // Inside: all of one sign. Ahead: the plane, too.
          const bool inside = (a >= 0 && b >= 0 && c >= 0) || (a <= 0 && b <= 0 && c <= 0);
          double& near = nearest[static_cast<std::size_t>((y - from) * spec.width + x)];
          if (!inside || !(z > 0) || z >= near) continue;
          near = z;
          made.pixels_[static_cast<std::size_t>(y) * static_cast<std::size_t>(spec.width) +
                       static_cast<std::size_t>(x)] = {k, static_cast<float>(b / sum), static_cast<float>(c / sum)};
        }
      }
    }
  });
  return made;
}

std::optional<Vector2d> MeshView::texture(int x, int y) const {
  const Seen& seen =
      pixels_[static_cast<std::size_t>(y) * static_cast<std::size_t>(width_) + static_cast<std::size_t>(x)];
  if (seen.triangle == kNone) return std::nullopt;
  const std::array<Vector2d, 3>& corners = textures_[seen.triangle];
  const double second = seen.second, third = seen.third;
  return Vector2d((1 - second - third) * corners[0] + second * corners[1] + third * corners[2]);
}

template <class Sample>
DecodedImage MeshView::paint_as(const ImageView& raymap, bool corners_only, const parallel::Workers& workers) const {
  const int channels = component_count(raymap.format);
  DecodedImage made{raymap.format, width_, height_, {}};
  made.bytes.resize(packed_size(made.format, width_, height_));
  workers.run(height_, [&](int y) {
    for (int x = 0; x < width_; ++x) {
      const std::optional<Vector2d> at = texture(x, y);
      if (!at) continue;
      const std::size_t pixel =
          static_cast<std::size_t>(y) * static_cast<std::size_t>(width_) + static_cast<std::size_t>(x);
      const Seen& seen = pixels_[pixel];
      std::array<double, 3> sum{};
      if (corners_only) {
        const std::array<double, 3> weights{1.0 - seen.second - seen.third, seen.second, seen.third};
        for (std::size_t k = 0; k < 3; ++k)
          add_texture<Sample>(raymap, channels, textures_[seen.triangle][k], weights[k], sum);
      } else {
        add_texture<Sample>(raymap, channels, *at, 1, sum);
      }
      for (std::size_t c = 0; c < static_cast<std::size_t>(channels); ++c) {
        const double level = std::clamp(sum[c] + 0.5, 0.0, double{view::Samples<Sample>::kMax});
        view::store(static_cast<Sample>(level),
                    &made.bytes[(pixel * static_cast<std::size_t>(channels) + c) * sizeof(Sample)]);
      }
    }
  });
  return made;
}

DecodedImage MeshView::paint(const ImageView& raymap, bool corners_only, const parallel::Workers& workers) const {
  return is_linear16(raymap.format) ? paint_as<std::uint16_t>(raymap, corners_only, workers)
                                    : paint_as<std::uint8_t>(raymap, corners_only, workers);
}

}  // namespace nodal::mesh
