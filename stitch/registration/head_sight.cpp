#include "stitch/registration/head_sight.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace nodal::registration {

HeadSight sight_of(const HeadState& head, const RadialTable& table, double used_angle,
                   const std::vector<PlaneRef>& planes, double level_scale, double margin_px) {
  HeadSight sight{};
  const Eigen::Matrix3d R = head.q_head_rig.toRotationMatrix();
  for (int k = 0; k < 9; ++k) sight.R[k] = static_cast<float>(R(k / 3, k % 3));
  for (int k = 0; k < 3; ++k) sight.axis[k] = static_cast<float>(R(2, k));
  const Eigen::Vector3d position = R * head.position;
  for (int k = 0; k < 3; ++k) sight.position[k] = static_cast<float>(position[k]);
  sight.nearness = static_cast<float>(head.nearness);
  const double reach = std::min(used_angle + head.parallax(), std::numbers::pi);
  sight.cos_reach = static_cast<float>(std::cos(reach));
  sight.sin_reach = static_cast<float>(std::sin(reach));
  sight.table = &table;
  sight.center_x = static_cast<float>(head.center_x);
  sight.center_y = static_cast<float>(head.center_y);
  sight.aspect = static_cast<float>(head.aspect);
  const PlaneRef& first = planes.front();
  sight.level_scale = static_cast<float>(level_scale);
  sight.width = first.width;
  sight.height = first.height;
  // Interpolation is possible up to a level's outermost pixel centres.
  const auto low = [&](double edge) { return static_cast<float>(std::max(edge + margin_px, 0.5 * level_scale)); };
  const auto high = [&](double edge, int pixels) {
    return static_cast<float>(std::min(edge - margin_px, (pixels - 0.5) * level_scale));
  };
  sight.left = low(head.region.left);
  sight.top = low(head.region.top);
  sight.right = high(head.region.right, first.width);
  sight.bottom = high(head.region.bottom, first.height);
  const Region::Circle everywhere{0, 0, 1e9};
  const Region::Circle circle = head.region.circle.value_or(everywhere);
  sight.circle_x = static_cast<float>(circle.x);
  sight.circle_y = static_cast<float>(circle.y);
  sight.circle_radius2 = static_cast<float>(std::pow(std::max(0.0, circle.radius - margin_px), 2));
  sight.masks = head.masks.get();
  sight.mask_margin = static_cast<float>(std::max(margin_px, 0.0));
  sight.vignetting_x = static_cast<float>(head.center_x + head.vignetting_x);
  sight.vignetting_y = static_cast<float>(head.center_y + head.vignetting_y);
  sight.per_vignetting_radius2 = static_cast<float>(1 / (head.vignetting_radius * head.vignetting_radius));
  for (std::size_t k = 0; k < 3; ++k) sight.vignetting[k] = static_cast<float>(head.vignetting[k]);
  for (std::size_t k = 0; k < 3; ++k) sight.gain[k] = static_cast<float>(std::exp(head.log_gain[k]));
  sight.planes = planes;
  return sight;
}

}  // namespace nodal::registration
