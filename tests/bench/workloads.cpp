#include "tests/bench/workloads.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "protocol/base/angles.h"
#include "stitch/geometry/head.h"
#include "stitch/geometry/rotation.h"

namespace nodal::bench {
namespace {

HeadCalibration head_at(int index, int width, int height, LensModel lens, geometry::YawPitchRoll pose) {
  HeadCalibration head;
  head.name = "head" + std::to_string(index);
  head.width = width;
  head.height = height;
  head.center_x = width / 2.0;
  head.center_y = height / 2.0;
  head.lens = std::move(lens);
  head.R_head_rig = geometry::rows_of(geometry::to_R_head_rig(pose));
  head.region = {0, 0, static_cast<double>(width), static_cast<double>(height), std::nullopt};
  head.vignetting = {head.center_x, head.center_y, width * 0.6, {-0.15, -0.05, 0}};
  head.gain.fill(0.95 + 0.01 * index);
  return head;
}

/// Points on the sphere that repel each other, starting from a spiral.
std::vector<Eigen::Vector3d> spread_points(int count) {
  std::vector<Eigen::Vector3d> points;
  for (int k = 0; k < count; ++k) {
    const double y = 1 - (2 * k + 1.0) / count, turn = k * std::numbers::pi * (3 - std::sqrt(5.0));
    const double level = std::sqrt(1 - y * y);
    points.emplace_back(level * std::sin(turn), y, level * std::cos(turn));
  }
  for (int round = 0; round < 2000; ++round) {
    const std::vector<Eigen::Vector3d> before = points;
    for (Eigen::Vector3d& p : points) {
      Eigen::Vector3d push = Eigen::Vector3d::Zero();
      for (const Eigen::Vector3d& q : before) {
        const double distance = (p - q).norm();
        if (distance > 1e-6) push += (p - q) / (distance * distance * distance);
      }
      p = (p + 0.2 / count * push).normalized();
    }
  }
  return points;
}

/// Between -100 and 100.
double scene(const Eigen::Vector3d& d, int component, std::uint32_t seed) {
  const double shift = 0.37 * seed + component;
  double sum = 0;
  double fineness = 3;
  for (const double height : {40.0, 25.0, 15.0, 10.0, 6.0}) {
    sum += height * std::sin(fineness * d.x() + shift) * std::sin(1.1 * fineness * (d.y() + 0.5 * d.z()) + 0.7);
    fineness *= 2.9;
  }
  return sum;
}

}  // namespace

Workload r10() {
  Workload work{"r10", {}, {"equirectangular", 2048, 1024, PixelFormat::kI420}};
  work.rig.name = work.name;
  const double t = std::tan(50 * kRadiansPerDegree);
  const double focal = 360 / (t * (1 - 0.1 * t * t));
  for (int h = 0; h < 10; ++h) {
    geometry::YawPitchRoll pose{(h % 4) * 90.0 + (h < 4 ? 0 : 45), h < 4 ? 31.0 : -31.0, 0};
    if (h >= 8) pose = {20, h == 8 ? 90.0 : -90.0, 0};
    work.rig.heads.push_back(head_at(h, 720, 480, RectilinearLens{{focal, 0, -0.1 * focal}}, pose));
    work.rig.heads.back().max_angle = 60.5 * kRadiansPerDegree;  // it turns back at 61.3, just inside the corners
  }
  return work;
}

Workload r8() {
  Workload work{"r8", {}, {"equirectangular", 3840, 1920, PixelFormat::kI420}};
  work.rig.name = work.name;
  const double a = 41 * kRadiansPerDegree;
  const double focal = 540 / (a * (1 - 0.03 * a * a));
  for (int h = 0; h < 8; ++h) {
    geometry::YawPitchRoll pose{h * 60.0, 0, 90};
    if (h >= 6) pose = {0, h == 6 ? 90.0 : -90.0, 0};
    work.rig.heads.push_back(head_at(h, 1920, 1080, KannalaBrandtLens{focal, {-0.03, 0, 0, 0}}, pose));
    work.rig.heads.back().max_angle = 1.75;
  }
  return work;
}

Workload spread(int heads, double heads_a_ray, int width) {
  Workload work{"spread", {}, {"equirectangular", width, width / 2, PixelFormat::kI420}};
  work.rig.name = work.name;
  const double half_angle = std::acos(1 - 2 * heads_a_ray / heads);
  const double focal = width / (2 * std::numbers::pi);
  const double radius = 2 * focal * std::sin(half_angle / 2);
  const int side = static_cast<int>(std::ceil(2 * radius / 16)) * 16;
  const KannalaBrandtLens lens{focal, {-1.0 / 24, 1.0 / 1920, -1.0 / 322560, 1.0 / 92897280}};  // 2 sin(a / 2)
  for (const Eigen::Vector3d& axis : spread_points(heads)) {
    const double yaw = std::atan2(axis.x(), axis.z()) / kRadiansPerDegree,
                 pitch = -std::asin(axis.y()) / kRadiansPerDegree;
    const int index = static_cast<int>(work.rig.heads.size());
    work.rig.heads.push_back(head_at(index, side, side, lens, {yaw, pitch, 0}));
    HeadCalibration& head = work.rig.heads.back();
    head.max_angle = half_angle;
    head.region = {side / 2.0 - radius, side / 2.0 - radius, side / 2.0 + radius, side / 2.0 + radius,
                   Region::Circle{side / 2.0, side / 2.0, radius}};
  }
  return work;
}

FilmedSet film(const Calibration& rig, PixelFormat format, std::uint32_t seed) {
  FilmedSet set;
  std::uint32_t noise = 2654435761U * (seed + 1);
  for (const HeadCalibration& calibration : rig.heads) {
    const geometry::Head head = geometry::Head::make(calibration).value();
    std::vector<std::uint8_t>& memory = set.memory.emplace_back(packed_size(format, head.width(), head.height()));
    const MutableImageView image = packed_image(format, head.width(), head.height(), memory.data());
    for (int c = 0; c < component_count(format); ++c) {
      const MutablePlaneView& plane = image.planes[static_cast<std::size_t>(c)];
      const PlaneGrid plane_grid = component_grid(format, c);
      const bool chroma = format != PixelFormat::kRgb24 && c > 0;
      for (int y = 0; y < plane.height; ++y) {
        for (int x = 0; x < plane.width; ++x) {
          noise = noise * 1664525U + 1013904223U;
          const geometry::Pixel at{(x + 0.5 - plane_grid.offset_x) * plane_grid.step_x,
                                   (y + 0.5 - plane_grid.offset_y) * plane_grid.step_y};
          const std::optional<geometry::Ray> ray = head.unproject(at);
          const double own = ray ? scene(ray->direction(), c, seed) : 0;
          const double light = calibration.gain[0] * head.vignetting(at);
          const double level = chroma ? 128 + 0.5 * own * light : (120 + own) * light + (noise >> 29) - 3.5;
          plane.data[y * plane.row_stride + std::ptrdiff_t{x} * plane.pixel_stride] =
              static_cast<std::uint8_t>(std::clamp(level, 0.0, 255.0));
        }
      }
    }
    set.heads.push_back(packed_image(format, head.width(), head.height(), std::as_const(memory).data()));
  }
  return set;
}

FilmedSet copy(const FilmedSet& set) {
  FilmedSet other{set.memory, {}};
  for (std::size_t h = 0; h < set.heads.size(); ++h) {
    const ImageView& head = set.heads[h];
    other.heads.push_back(packed_image(head.format, head.width, head.height, std::as_const(other.memory[h]).data()));
  }
  return other;
}

}  // namespace nodal::bench
