#include "tests/support/rendered_rig.h"

#include <Eigen/Geometry>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>
#include <memory>
#include <numbers>
#include <random>

#include "hal/sim/head.h"
#include "hal/sim/scene/sensor.h"

namespace nodal::test {
namespace {

using RowMajor = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;

Eigen::Matrix3d rotation_of(const HeadCalibration& head) { return Eigen::Map<const RowMajor>(head.R_head_rig.data()); }

void set_rotation(HeadCalibration& head, const Eigen::Matrix3d& R) { Eigen::Map<RowMajor>(head.R_head_rig.data()) = R; }

constexpr double kDegrees = 180 / std::numbers::pi;

/// A head whose picture's rows lie along `down` (at right angles to `forward`).
void add_equidistant(Calibration& rig, int side, double view_deg, const Eigen::Vector3d& down,
                     const Eigen::Vector3d& forward) {
  HeadCalibration head;
  head.name = "cam" + std::to_string(rig.heads.size());
  head.width = head.height = side;
  head.center_x = head.center_y = side / 2.0;
  head.lens = EquidistantLens{{side / 2.0 / (view_deg / 2 / kDegrees)}};
  head.region = {0, 0, static_cast<double>(side), static_cast<double>(side), {}};
  head.vignetting = {side / 2.0, side / 2.0, side / 2.0, {}};
  const Eigen::Vector3d right = down.cross(forward);
  Eigen::Matrix3d R;
  R << right.transpose(), down.transpose(), forward.transpose();
  set_rotation(head, R);
  rig.heads.push_back(head);
}

class Tiles final : public hal::sim::Scene {
 public:
  explicit Tiles(double unevenness) : unevenness_(unevenness) {}

  hal::sim::Light light(const hal::sim::Direction& d, double) const override {
    const double yaw = std::atan2(d.x, d.z) * kDegrees;
    const double pitch = std::asin(std::clamp(-d.y, -1.0, 1.0)) * kDegrees;
    const bool dark = (static_cast<int>(std::floor(yaw / 10)) + static_cast<int>(std::floor(pitch / 10))) % 2 == 0;
    const auto window = [](double a) { return std::abs(std::fmod(a + 360, 10) - 5) < 2; };
    const double uneven = 0.15 * d.x - 0.1 * d.y + 0.08 * std::sin(3 * yaw / kDegrees);
    const auto light = static_cast<float>(0.8 + unevenness_ * uneven);
    const float level = light * ((dark ? 0.3F : 0.55F) + (window(yaw) && window(pitch) ? 0.2F : 0.0F));
    return {level, level, level};
  }

 private:
  double unevenness_;
};

/// Where a look into a room ends: how far away, and in which direction from the nodal point the walls show the same.
struct Hit {
  double away = 0;
  Eigen::Vector3d wall;
};

Hit hit_in(const Room& room, const Eigen::Vector3d& eye, const Eigen::Vector3d& d) {
  double away = 0;
  if (room.shape == Room::Shape::kBall) {  // |eye + away d| = size
    const double b = eye.dot(d);
    away = -b + std::sqrt(b * b - eye.squaredNorm() + room.size * room.size);
  } else {
    away = 1e9;
    for (int k = 0; k < 3; ++k) {
      if (d[k] != 0) away = std::min(away, ((d[k] > 0 ? room.size : -room.size) - eye[k]) / d[k]);
    }
  }
  Eigen::Vector3d wall = (eye + away * d).normalized();
  for (const Room::Column& column : room.columns) {
    const Eigen::Vector2d apart(eye.x() - column.x, eye.z() - column.z), way(d.x(), d.z());
    const double a = way.squaredNorm(), b = apart.dot(way);
    const double root = b * b - a * (apart.squaredNorm() - column.radius * column.radius);
    if (a < 1e-12 || root < 0 || (-b - std::sqrt(root)) / a <= 0 || (-b - std::sqrt(root)) / a >= away) continue;
    away = (-b - std::sqrt(root)) / a;
    const Eigen::Vector3d at = eye + away * d;  // its pattern: the walls' by the direction from its own axis
    wall = Eigen::Vector3d(at.x() - column.x, at.y() / 4, at.z() - column.z).normalized();
  }
  return {away, wall};
}

/// A room seen from one point in it.
class RoomFrom final : public hal::sim::Scene {
 public:
  RoomFrom(const Room& room, const Eigen::Vector3d& eye, hal::sim::ScenePtr walls)
      : room_(room), eye_(eye), walls_(std::move(walls)) {}
  hal::sim::Light light(const hal::sim::Direction& from, double footprint_rad) const override {
    const Eigen::Vector3d wall = hit_in(room_, eye_, {from.x, from.y, from.z}).wall;
    return walls_->light({wall.x(), wall.y(), wall.z()}, footprint_rad);
  }

 private:
  const Room room_;
  const Eigen::Vector3d eye_;
  const hal::sim::ScenePtr walls_;
};

}  // namespace

std::vector<ImageView> RenderedRig::frames() const {
  std::vector<ImageView> views;
  for (std::size_t h = 0; h < bytes.size(); ++h) {
    views.push_back(packed_image(format, truth.heads[h].width, truth.heads[h].height, bytes[h].data()));
  }
  return views;
}

namespace {

template <class SceneOf>
RenderedRig render(const Calibration& truth, const RenderOptions& options, SceneOf&& scene_of) {
  RenderedRig rig{truth, options.format, {}};
  hal::sim::HeadOptions head_options;
  head_options.pixels = options.format;
  head_options.supersampling = options.supersampling;
  head_options.noise.levels = options.noise_levels;
  std::uint64_t seed = options.seed * 1000;
  for (const HeadCalibration& head : truth.heads) {
    hal::sim::Sensor sensor(head, hal::sim::sensor_options(head_options), scene_of(head), ++seed);
    std::vector<std::uint8_t> picture(packed_size(options.format, head.width, head.height));
    sensor.render(head_options.settings, Instant::from_ns(1'000'000'000), 0, picture, 0);
    rig.bytes.push_back(std::move(picture));
  }
  return rig;
}

}  // namespace

RenderedRig render_rig(const Calibration& truth, const hal::sim::ScenePtr& scene, const RenderOptions& options) {
  return render(truth, options, [&](const HeadCalibration&) { return scene; });
}

RenderedRig render_rig_in(const Room& room, const Calibration& truth, const hal::sim::ScenePtr& scene,
                          const RenderOptions& options) {
  return render(truth, options,
                [&](const HeadCalibration& head) { return what_a_rig_sees(room, head.position, scene); });
}

hal::sim::ScenePtr what_a_rig_sees(const Room& room, const std::array<double, 3>& from,
                                   const hal::sim::ScenePtr& walls) {
  return std::make_shared<RoomFrom>(room, Eigen::Vector3d(from[0], from[1], from[2]), walls);
}

double range_in(const Room& room, const std::array<double, 3>& from, const std::array<double, 3>& direction) {
  return hit_in(room, {from[0], from[1], from[2]}, {direction[0], direction[1], direction[2]}).away;
}

hal::sim::ScenePtr tiles_scene(double unevenness) { return std::make_shared<Tiles>(unevenness); }

Calibration spread_out(Calibration rig, double forward) {
  for (HeadCalibration& head : rig.heads) {
    const Eigen::Vector3d at = forward * rotation_of(head).row(2).transpose();
    head.position = {at.x(), at.y(), at.z()};
  }
  return rig;
}

Calibration six_fisheyes(int side, double view_deg) {
  Calibration rig;
  rig.name = "six fisheyes";
  const Eigen::Vector3d forward[] = {{0, 0, 1}, {1, 0, 0}, {0, 0, -1}, {-1, 0, 0}, {0, 1, 0}, {0, -1, 0}};
  for (const Eigen::Vector3d& z : forward) {
    const Eigen::Vector3d down = std::abs(z.y()) > 0.5 ? Eigen::Vector3d(0, 0, 1) : Eigen::Vector3d(0, 1, 0);
    add_equidistant(rig, side, view_deg, down, z);
  }
  return rig;
}

Calibration three_rings(int side, double view_deg) {
  Calibration rig;
  rig.name = "three rings";
  for (const double pitch : {-48 / kDegrees, 0.0, 48 / kDegrees}) {
    for (int k = 0; k < 8; ++k) {
      const double yaw = (45 * k + 10) / kDegrees;
      const Eigen::Vector3d z(std::sin(yaw) * std::cos(pitch), -std::sin(pitch), std::cos(yaw) * std::cos(pitch));
      const Eigen::Vector3d down = Eigen::Vector3d(0, 1, 0) - z.y() * z;
      add_equidistant(rig, side, view_deg, down.normalized(), z);
    }
  }
  return rig;
}

Calibration turned(Calibration rig, double least_deg, double most_deg, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> uniform(least_deg, most_deg);
  for (HeadCalibration& head : rig.heads) {
    const double x = normal(random), y = normal(random), z = normal(random);
    const Eigen::Vector3d axis = Eigen::Vector3d(x, y, z).normalized();
    set_rotation(head, Eigen::AngleAxisd(uniform(random) / kDegrees, axis) * rotation_of(head));
  }
  return rig;
}

RotationError rotation_error(const Calibration& truth, const Calibration& found, const std::vector<bool>& counted) {
  const auto counts = [&](std::size_t h) { return counted.empty() || counted[h]; };
  Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
  for (std::size_t h = 0; h < truth.heads.size(); ++h) {
    if (counts(h)) sum += rotation_of(truth.heads[h]).transpose() * rotation_of(found.heads[h]);
  }
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(sum, Eigen::ComputeFullU | Eigen::ComputeFullV);
  const Eigen::Matrix3d UVt = svd.matrixU() * svd.matrixV().transpose();
  const Eigen::Vector3d signs(1, 1, UVt.determinant());
  const Eigen::Matrix3d common = svd.matrixU() * signs.asDiagonal() * svd.matrixV().transpose();
  RotationError error;
  double squares = 0;
  int heads = 0;
  for (std::size_t h = 0; h < truth.heads.size(); ++h) {
    if (!counts(h)) continue;
    const Eigen::Matrix3d apart = rotation_of(found.heads[h]) * (rotation_of(truth.heads[h]) * common).transpose();
    // From the chord, which is accurate for small angles, unlike an arc cosine.
    const double chord = (apart - Eigen::Matrix3d::Identity()).norm() / (2 * std::numbers::sqrt2);
    const double degrees = 2 * std::asin(std::min(1.0, chord)) * kDegrees;
    squares += degrees * degrees;
    error.max_deg = std::max(error.max_deg, degrees);
    ++heads;
  }
  error.rms_deg = heads > 0 ? std::sqrt(squares / heads) : 0;
  return error;
}

}  // namespace nodal::test
