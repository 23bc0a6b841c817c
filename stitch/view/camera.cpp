#include "stitch/view/camera.h"

#include <array>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <string>

#include "protocol/base/angles.h"

namespace nodal::view {
namespace {

using geometry::Ray;

struct Known {
  std::string_view name;
  Projection projection;
  int widest_deg;  ///< field of view; of kPannini: with d = 1
};

// In the order of Projection. Formulas: Snyder, "Map Projections: A Working Manual", 1987; of kPannini: Sharpless, Postle and
// German, "Pannini: A New Projection for Rendering Wide Angle Perspective Images", 2010.
constexpr std::array kKnown{
    Known{"perspective", Projection::kPerspective, 179},
    Known{"fisheye", Projection::kFisheye, 360},
    Known{"stereographic", Projection::kStereographic, 359},
    Known{"equisolid", Projection::kEquisolid, 360},
    Known{"orthographic", Projection::kOrthographic, 180},
    Known{"pannini", Projection::kPannini, 359},
    Known{"cylindrical", Projection::kCylindrical, 360},
    Known{"cylinder_equal_area", Projection::kCylinderEqualArea, 360},
    Known{"mercator", Projection::kMercator, 360},
    Known{"equirectangular", Projection::kEquirectangular, 360},
};
constexpr double kMostD = 100;

const Known& known(Projection projection) { return kKnown[static_cast<std::size_t>(projection)]; }

std::string number(double value) {
  std::array<char, 32> text{};
  std::snprintf(text.data(), text.size(), "%g", value);
  return text.data();
}

/// How far from the centre the ray at this angle to the right of the axis is shown, in focal lengths.
double offset(const CameraName& name, double angle) {
  switch (name.projection) {
    case Projection::kPerspective: return std::tan(angle);
    case Projection::kStereographic: return 2 * std::tan(angle / 2);
    case Projection::kEquisolid: return 2 * std::sin(angle / 2);
    case Projection::kOrthographic: return std::sin(angle);
    case Projection::kPannini: return (name.d + 1) * std::sin(angle) / (name.d + std::cos(angle));
    default: return angle;
  }
}

/// The inverse; NaN beyond the largest offset.
double angle(const CameraName& name, double offset) {
  switch (name.projection) {
    case Projection::kPerspective: return std::atan(offset);
    case Projection::kFisheye: return offset <= kPi ? offset : std::nan("");
    case Projection::kStereographic: return 2 * std::atan(offset / 2);
    case Projection::kEquisolid: return 2 * std::asin(offset / 2);
    case Projection::kOrthographic: return std::asin(offset);
    case Projection::kPannini: {
      // With t = offset / (d + 1), sin a - t cos a = t d: the left side is sqrt(1 + t^2) sin(a - atan t).
      const double t = offset / (name.d + 1);
      return std::atan(t) + std::asin(t * name.d / std::hypot(1, t));
    }
    default: return offset;
  }
}

/// The angle phi of what an upright projection shows `down` focal lengths below its horizon, at `theta`; NaN where there
/// is none.
double phi(const CameraName& name, double theta, double down) {
  switch (name.projection) {
    case Projection::kPannini: return std::atan(down * (name.d + std::cos(theta)) / (name.d + 1));
    case Projection::kCylindrical: return std::atan(down);
    case Projection::kCylinderEqualArea: return std::asin(down);
    case Projection::kMercator: return std::atan(std::sinh(down));
    default: return std::abs(down) <= kPi / 2 ? down : std::nan("");
  }
}

}  // namespace

int CameraName::widest_fov_deg() const {
  if (projection != Projection::kPannini) return known(projection).widest_deg;
  // The offset grows to infinity at cos a = -d, or for d > 1 to its largest value at cos a = -1 / d.
  const double limit_deg = 360 / kPi * std::acos(d > 1 ? -1 / d : -d);
  return static_cast<int>(std::ceil(limit_deg - 1e-9)) - 1;
}

std::vector<std::string_view> camera_names() {
  std::vector<std::string_view> names;
  for (const Known& each : kKnown) names.push_back(each.name);
  return names;
}

Result<CameraName> parse_camera(std::string_view text) {
  const std::string_view name = text.substr(0, text.find(':'));
  std::string names;
  for (const Known& each : kKnown) {
    names += (names.empty() ? "" : ", ") + std::string(each.name);
    if (each.name != name) continue;
    CameraName made{each.projection};
    if (name.size() == text.size()) return made;
    const std::string_view rest = text.substr(name.size() + 1);
    if (each.projection != Projection::kPannini) {
      return fail(Errc::kBadValue, "the camera " + std::string(name) + " has no parameter, but '" +
                                       std::string(rest.substr(0, 64)) + "' follows its name");
    }
    constexpr std::string_view kKey = "d=";
    const char* end = rest.data() + rest.size();
    bool good = rest.starts_with(kKey);
    if (good) {
      const auto [at, error] = std::from_chars(rest.data() + kKey.size(), end, made.d);
      good = error == std::errc() && at == end && made.d >= 0 && made.d <= kMostD;
    }
    if (good) return made;
    return fail(Errc::kBadValue, "camera '" + std::string(text.substr(0, 64)) +
                                     "': after pannini: there may be d=D, a number from 0 to " + number(kMostD));
  }
  return fail(Errc::kBadValue, "no camera is called '" + std::string(name.substr(0, 64)) + "'; there are: " + names);
}

Camera::Camera(const CameraSpec& spec)
    : spec_(spec),
      focal_(0.5 * spec.width / offset(spec.name, spec.fov_deg * kPi / 360)),
      R_rig_camera_(geometry::to_R_head_rig(spec.pose).transpose()) {}

Result<Camera> Camera::make(const CameraSpec& spec) {
  const int widest = spec.name.widest_fov_deg();
  if (!(spec.fov_deg >= CameraName::kLeastFovDeg && spec.fov_deg <= widest)) {
    std::string camera(known(spec.name.projection).name);
    if (spec.name.projection == Projection::kPannini) camera += ":d=" + number(spec.name.d);
    return fail(Errc::kBadValue, "a field of view of " + number(spec.fov_deg) + " degrees; the " + camera +
                                     " camera shows " + std::to_string(CameraName::kLeastFovDeg) + " to " +
                                     std::to_string(widest));
  }
  return Camera(spec);
}

std::optional<Ray> Camera::ray(double x, double y) const {
  const double a = (x - 0.5 * spec_.width) / focal_, b = (y - 0.5 * spec_.height) / focal_;
  if (spec_.name.projection == Projection::kPerspective) return Ray::towards(R_rig_camera_ * Eigen::Vector3d(a, b, 1));
  if (spec_.name.projection >= Projection::kPannini) {
    const double right = angle(spec_.name, a), down = phi(spec_.name, right, b);
    if (std::isnan(right) || std::isnan(down)) return std::nullopt;
    return R_rig_camera_ * Ray::at({right, down});
  }
  const double r = std::hypot(a, b);
  const double off = angle(spec_.name, r);
  if (std::isnan(off)) return std::nullopt;
  const double across = r > 0 ? std::sin(off) / r : 0;
  return Ray::towards(R_rig_camera_ * Eigen::Vector3d(a * across, b * across, std::cos(off)));
}

}  // namespace nodal::view
