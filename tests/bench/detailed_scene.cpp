#include "detailed_scene.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "hal/sim/scene/texture.h"

namespace nodal::bench {
namespace {

constexpr int kOctaves = 8, kCoarse = 2;

}  // namespace

DetailedScene::DetailedScene(Detail detail)
    : detail_(detail),
      R_lattice_rig_(Eigen::AngleAxisd(0.9, Eigen::Vector3d(3, 1, 2).normalized()).toRotationMatrix()) {}

double DetailedScene::level(const Eigen::Vector3d& ray) const {
  const Eigen::Vector3d at = R_lattice_rig_ * ray;
  const double latitude = std::asin(std::clamp(ray.y(), -1.0, 1.0));
  const double fine = detail_ == Detail::kEverywhere ? 1 : std::exp(-latitude * latitude / (2 * 0.2 * 0.2));
  double sum = 0, strength = 110, scale = 3;
  for (int k = 0; k < kOctaves; ++k, strength *= 0.8, scale *= 2) {
    const double part = k < kCoarse ? 1 : fine;
    if (part < 1e-4) break;
    const double noise = hal::sim::value_noise(scale * at.x() + 17.3 * k, scale * at.y() + 5.7 * k,
                                               scale * at.z() - 9.1 * k, static_cast<std::uint32_t>(k + 1));
    sum += part * strength * (noise - 0.5);
  }
  return std::clamp(128 + sum, 0.0, 255.0);
}

}  // namespace nodal::bench
