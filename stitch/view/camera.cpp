#include "stitch/view/camera.h"

#include <array>
#include <cmath>
#include <cstdio>
#include <string>

#include "protocol/base/angles.h"

namespace nodal::view {
namespace {

struct Known {
  std::string_view name;
  Projection projection;
  double widest_deg;  ///< field of view
};

constexpr std::array kKnown{
    Known{"perspective", Projection::kPerspective, 179}, Known{"fisheye", Projection::kFisheye, 360},
    Known{"stereographic", Projection::kStereographic, 359}, Known{"equisolid", Projection::kEquisolid, 360}};

double radius(Projection projection, double angle) {
  switch (projection) {
    case Projection::kPerspective: return std::tan(angle);
    case Projection::kFisheye: return angle;
    case Projection::kStereographic: return 2 * std::tan(angle / 2);
    case Projection::kEquisolid: return 2 * std::sin(angle / 2);
  }
  return 0;
}

/// The inverse; NaN beyond the largest radius.
double angle(Projection projection, double radius) {
  switch (projection) {
    case Projection::kPerspective: return std::atan(radius);
    case Projection::kFisheye: return radius <= kPi ? radius : std::nan("");
    case Projection::kStereographic: return 2 * std::atan(radius / 2);
    case Projection::kEquisolid: return 2 * std::asin(radius / 2);
  }
  return 0;
}

}  // namespace

Result<Projection> parse_projection(std::string_view text) {
  std::string names;
  for (const Known& known : kKnown) {
    if (known.name == text) return known.projection;
    names += (names.empty() ? "" : ", ") + std::string(known.name);
  }
  return fail(Errc::kBadValue, "no camera is called '" + std::string(text.substr(0, 64)) + "'; there are: " + names);
}

Camera::Camera(const CameraSpec& spec)
    : spec_(spec),
      focal_(0.5 * spec.width / radius(spec.projection, spec.fov_deg * kPi / 360)),
      R_rig_camera_(geometry::to_R_head_rig(spec.pose).transpose()) {}

Result<Camera> Camera::make(const CameraSpec& spec) {
  const Known& known = kKnown[static_cast<std::size_t>(spec.projection)];
  if (!(spec.fov_deg >= 1 && spec.fov_deg <= known.widest_deg)) {
    std::array<char, 32> given{};
    std::snprintf(given.data(), given.size(), "%g", spec.fov_deg);
    return fail(Errc::kBadValue, "a field of view of " + std::string(given.data()) + " degrees; a " +
                                     std::string(known.name) + " camera shows 1 to " +
                                     std::to_string(static_cast<int>(known.widest_deg)));
  }
  return Camera(spec);
}

std::optional<geometry::Ray> Camera::ray(double x, double y) const {
  const double a = (x - 0.5 * spec_.width) / focal_, b = (y - 0.5 * spec_.height) / focal_;
  if (spec_.projection == Projection::kPerspective) {
    return geometry::Ray::towards(R_rig_camera_ * Eigen::Vector3d(a, b, 1));
  }
  const double r = std::hypot(a, b);
  const double off = angle(spec_.projection, r);
  if (std::isnan(off)) return std::nullopt;
  const double across = r > 0 ? std::sin(off) / r : 0;
  return geometry::Ray::towards(R_rig_camera_ * Eigen::Vector3d(a * across, b * across, std::cos(off)));
}

}  // namespace nodal::view
