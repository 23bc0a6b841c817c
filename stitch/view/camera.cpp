#include "stitch/view/camera.h"

#include <fmt/format.h>

#include <array>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <span>
#include <string>

#include "protocol/base/angles.h"
#include "stitch/geometry/lens/rising_polynomial.h"

namespace nodal::view {
namespace {

using geometry::Ray;
using geometry::RisingPolynomial;

struct Known {
  std::string_view name;
  Projection projection;
  int widest_deg;  ///< field of view; of kPannini: with d = 1
};

// In the order of Projection. Formulas: Snyder, "Map Projections: A Working Manual", 1987; of kPannini: Sharpless,
// Postle and German, "Pannini: A New Projection for Rendering Wide Angle Perspective Images", 2010.
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
constexpr double kMaxD = 100;
constexpr double kMinF1 = 1e-6, kMaxF = 1e6;

const Known& known(Projection projection) { return kKnown[static_cast<std::size_t>(projection)]; }

std::string number(double value) {
  std::array<char, 32> text{};
  std::snprintf(text.data(), text.size(), "%g", value);
  return text.data();
}

/// As parse_camera() reads it.
std::string text_of(const CameraName& name) {
  std::string text(known(name.projection).name);
  if (name.projection == Projection::kPannini) return text + ":d=" + number(name.d);
  if (name.projection != Projection::kFisheye) return text;
  char before = ':';
  for (std::size_t k = 0; k < name.f.size(); ++k) {
    if (name.f[k] == CameraName().f[k]) continue;
    text += fmt::format("{}f{}={}", before, k + 1, number(name.f[k]));
    before = ',';
  }
  return text;
}

/// Reads all of `text` as a number. False for other text and for numbers outside of [least, most].
bool read_number(std::string_view text, double least, double most, double& value) {
  const char* end = text.data() + text.size();
  const auto [at, error] = std::from_chars(text.data(), end, value);
  return error == std::errc() && at == end && value >= least && value <= most;
}

/// "f1=1,f3=-0.05" and so on: any of f1 to f9, each once.
bool read_coefficients(std::string_view text, std::array<double, 9>& f) {
  std::array<bool, 9> given{};
  while (true) {
    const std::string_view each = text.substr(0, text.find(','));
    if (each.size() < 3 || each[0] != 'f' || each[1] < '1' || each[1] > '9' || each[2] != '=') return false;
    const auto k = static_cast<std::size_t>(each[1] - '1');
    if (given[k] || !read_number(each.substr(3), k == 0 ? kMinF1 : -kMaxF, kMaxF, f[k])) return false;
    given[k] = true;
    if (each.size() == text.size()) return true;
    text.remove_prefix(each.size() + 1);
  }
}

/// f1 to the last that is not 0, since every further one takes time.
std::span<const double> coefficients(const CameraName& name) {
  std::span<const double> f = name.f;
  while (f.size() > 1 && f.back() == 0) f = f.first(f.size() - 1);
  return f;
}

bool is_polynomial(const CameraName& name) {
  return name.projection == Projection::kFisheye && coefficients(name).size() > 1;
}

/// The field of view up to which a fisheye's r rises, degrees.
double rises_up_to_deg(const CameraName& name) { return 360 / kPi * RisingPolynomial(coefficients(name), kPi).max_x(); }

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

/// The angle phi of what an upright projection shows `down` focal lengths below its horizon, at `theta`; NaN where
/// there is none.
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
  if (is_polynomial(*this)) return static_cast<int>(rises_up_to_deg(*this) + 1e-9);
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
    const std::string start = "camera '" + std::string(text.substr(0, 64)) + "': ";
    if (each.projection == Projection::kPannini) {
      if (rest.starts_with("d=") && read_number(rest.substr(2), 0, kMaxD, made.d)) return made;
      return fail(Errc::kBadValue, start + "after pannini: there may be d=D, a number from 0 to " + number(kMaxD));
    }
    if (each.projection == Projection::kFisheye) {
      if (!read_coefficients(rest, made.f)) {
        return fail(Errc::kBadValue,
                    start + "after fisheye: there may be f1=F1,f2=F2 and so on up to f9, each once: F1 from " +
                        number(kMinF1) + " to " + number(kMaxF) + ", the others from " + number(-kMaxF) + " to " +
                        number(kMaxF));
      }
      if (made.widest_fov_deg() >= CameraName::kMinFovDeg) return made;
      return fail(Errc::kBadValue,
                  fmt::format("{}f1 a + f2 a^2 + ... rises only up to a field of view of {} degrees; the least is {}",
                              start, number(rises_up_to_deg(made)), CameraName::kMinFovDeg));
    }
    return fail(Errc::kBadValue, "the camera " + std::string(name) + " has no parameter, but '" +
                                     std::string(rest.substr(0, 64)) + "' follows its name");
  }
  return fail(Errc::kBadValue, "no camera is called '" + std::string(name.substr(0, 64)) + "'; there are: " + names);
}

Camera::Camera(const CameraSpec& spec)
    : spec_(spec),
      r_of_angle_(is_polynomial(spec.name) ? std::make_shared<const RisingPolynomial>(coefficients(spec.name), kPi)
                                           : nullptr),
      R_rig_camera_(geometry::to_R_head_rig(spec.pose).transpose()) {
  const double half = spec.fov_deg * kPi / 360;
  focal_ = 0.5 * spec.width / (r_of_angle_ ? r_of_angle_->value(half) : offset(spec.name, half));
}

Result<Camera> Camera::make(const CameraSpec& spec) {
  const int widest = spec.name.widest_fov_deg();
  if (!(spec.fov_deg >= CameraName::kMinFovDeg && spec.fov_deg <= widest)) {
    return fail(Errc::kBadValue, fmt::format("a field of view of {} degrees; the {} camera shows {} to {}",
                                             number(spec.fov_deg), text_of(spec.name), CameraName::kMinFovDeg, widest));
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
  const double off = r_of_angle_ ? r_of_angle_->inverse(r).value_or(std::nan("")) : angle(spec_.name, r);
  if (std::isnan(off)) return std::nullopt;
  const double across = r > 0 ? std::sin(off) / r : 0;
  return Ray::towards(R_rig_camera_ * Eigen::Vector3d(a * across, b * across, std::cos(off)));
}

}  // namespace nodal::view
