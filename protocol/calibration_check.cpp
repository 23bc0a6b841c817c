// Checks of a calibration beyond the presence of its fields; the first problem found is the error.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <string>

#include "protocol/base/angles.h"
#include "protocol/base/polynomial.h"
#include "protocol/base/text.h"
#include "protocol/base/try.h"
#include "protocol/base/units.h"
#include "protocol/calibration.h"
#include "protocol/calibration_limits.h"
#include "protocol/lens_range.h"

namespace nodal {
namespace {

constexpr int kMaxSide = 32768;           // px
constexpr double kMaxPlace = 1e6;         // px, for centres that may be outside the picture
constexpr double kMaxCoefficient = 1e12;  // keeps every sum below it finite
constexpr double kRotationTolerance = 1e-6;
constexpr std::size_t kMaxNameBytes = 64;
constexpr std::size_t kMaxTextBytes = 65536;

std::string six_digits(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.6g", value);
  return text;
}

std::string degrees(double radians) { return six_digits(radians * 180 / kPi) + " degrees"; }

/// Requires `least` <= value <= `most`; NaN is out of every range.
Status in_range(const std::string& field, double value, double least, double most) {
  if (value >= least && value <= most) return {};
  return fail(Errc::kBadValue,
              field + " is " + six_digits(value) + "; it must be " + six_digits(least) + " to " + six_digits(most));
}

Status coefficients_in_range(const std::string& field, std::span<const double> values) {
  for (std::size_t k = 0; k < values.size(); ++k) {
    NODAL_TRY(in_range(fmt::format("{}[{}]", field, k), values[k], -kMaxCoefficient, kMaxCoefficient));
  }
  return {};
}

Status check_focal(double focal) { return in_range("lens.focal", focal, 1, 1e6); }

Status check_count(const std::string& field, std::size_t count) {
  if (count >= 1 && count <= 9) return {};
  return fail(Errc::kBadValue, fmt::format("{} has {} numbers; it must have 1 to 9", field, count));
}

Status check_model(const TsaiLens& lens) {
  NODAL_TRY(check_focal(lens.focal));
  NODAL_TRY(in_range("lens.kappa1", lens.kappa1, -1, 1));
  return in_range("lens.kappa2", lens.kappa2, -1, 1);
}

Status check_polynomial(const std::vector<double>& coefficients) {
  NODAL_TRY(check_count("lens.coefficients", coefficients.size()));
  NODAL_TRY(in_range("lens.coefficients[0]", coefficients[0], 1, 1e6));
  return coefficients_in_range("lens.coefficients", coefficients);
}

Status check_model(const RectilinearLens& lens) { return check_polynomial(lens.coefficients); }
Status check_model(const EquidistantLens& lens) { return check_polynomial(lens.coefficients); }

Status check_model(const KannalaBrandtLens& lens) {
  NODAL_TRY(check_focal(lens.focal));
  return coefficients_in_range("lens.k", lens.k);
}

Status check_picture(const HeadCalibration& head) {
  NODAL_TRY(in_range("width", head.width, 1, kMaxSide));
  NODAL_TRY(in_range("height", head.height, 1, kMaxSide));
  NODAL_TRY(in_range("center[0]", head.center_x, -kMaxPlace, kMaxPlace));
  NODAL_TRY(in_range("center[1]", head.center_y, -kMaxPlace, kMaxPlace));
  return in_range("aspect", head.aspect, 0.1, 10);
}

Status check_rotation(const std::array<double, 9>& R) {
  const auto row = [&](std::size_t i, std::size_t k) { return R[3 * i + k]; };
  for (const double element : R) {
    if (!std::isfinite(element)) return fail(Errc::kBadValue, "R_head_rig has an element that is not a finite number");
  }
  double off = 0;
  for (std::size_t i = 0; i < 3; ++i) {
    for (std::size_t j = 0; j < 3; ++j) {
      double dot = i == j ? -1.0 : 0.0;
      for (std::size_t k = 0; k < 3; ++k) dot += row(i, k) * row(j, k);
      off = std::max(off, std::abs(dot));
    }
  }
  if (!(off <= kRotationTolerance)) {
    return fail(Errc::kNotARotation,
                "R_head_rig is not a rotation: its rows are off being perpendicular and of length 1 by " +
                    six_digits(off) + ", and at most 1e-06 is rounding; write more digits, or undo a scale or shear");
  }
  const double determinant = row(0, 0) * (row(1, 1) * row(2, 2) - row(1, 2) * row(2, 1)) -
                             row(0, 1) * (row(1, 0) * row(2, 2) - row(1, 2) * row(2, 0)) +
                             row(0, 2) * (row(1, 0) * row(2, 1) - row(1, 1) * row(2, 0));
  if (determinant < 0) {
    return fail(Errc::kNotARotation,
                "R_head_rig is a reflection, not a rotation (its determinant is -1): one axis points the wrong way; "
                "axes are x right, y down, z forward");
  }
  return {};
}

/// A mask without effect is an error, because it is most likely not what its author intended.
Status check_mask(const HeadCalibration& head, const std::string& field, const std::vector<Region::Point>& mask) {
  if (mask.size() < 3) {
    return fail(Errc::kBadValue, fmt::format("{} has {} corners; a polygon has 3 or more", field, mask.size()));
  }
  double left = kMaxPlace, right = -kMaxPlace, top = kMaxPlace, bottom = -kMaxPlace;
  for (std::size_t k = 0; k < mask.size(); ++k) {
    const std::string corner = fmt::format("{}[{}]", field, k);
    NODAL_TRY(in_range(corner + "[0]", mask[k].x, -kMaxPlace, kMaxPlace));
    NODAL_TRY(in_range(corner + "[1]", mask[k].y, -kMaxPlace, kMaxPlace));
    left = std::min(left, mask[k].x);
    right = std::max(right, mask[k].x);
    top = std::min(top, mask[k].y);
    bottom = std::max(bottom, mask[k].y);
  }
  double area = 0;  // twice the area of the largest triangle made of the first corner and two neighbouring corners
  for (std::size_t k = 1; k + 1 < mask.size(); ++k) {
    area = std::max(area, std::abs((mask[k].x - mask[0].x) * (mask[k + 1].y - mask[0].y) -
                                   (mask[k + 1].x - mask[0].x) * (mask[k].y - mask[0].y)));
  }
  if (!(area > 1e-3)) return fail(Errc::kBadValue, field + " has no area: its corners lie on a line");
  if (!(right > 0 && left < head.width && bottom > 0 && top < head.height)) {
    return fail(Errc::kBadValue, fmt::format("{} lies outside the picture of {}x{}: does it belong to another head?",
                                             field, head.width, head.height));
  }
  return {};
}

Status check_masks(const HeadCalibration& head) {
  const auto& masks = head.region.masks;
  if (masks.size() > kMaxMasks) {
    return fail(Errc::kBadValue, fmt::format("region.masks has more than {} polygons, the most", kMaxMasks));
  }
  std::size_t corners = 0;
  for (const std::vector<Region::Point>& mask : masks) corners += mask.size();
  if (corners > kMaxMaskPoints) {
    return fail(
        Errc::kBadValue,
        fmt::format(
            "region.masks has more than {} corners, the most for all polygons of a head together; draw simpler ones",
            kMaxMaskPoints));
  }
  for (std::size_t k = 0; k < masks.size(); ++k) {
    NODAL_TRY(check_mask(head, fmt::format("region.masks[{}]", k), masks[k]));
  }
  return {};
}

Status check_region(const HeadCalibration& head) {
  const Region& region = head.region;
  if (!(region.left >= 0 && region.top >= 0 && region.right <= head.width && region.bottom <= head.height)) {
    return fail(Errc::kBadValue, fmt::format("region {},{} to {},{} is not inside the picture of {}x{}",
                                             six_digits(region.left), six_digits(region.top), six_digits(region.right),
                                             six_digits(region.bottom), head.width, head.height));
  }
  if (!(region.left < region.right && region.top < region.bottom)) {
    return fail(Errc::kBadValue, "region is empty: left must be less than right, and top less than bottom");
  }
  NODAL_TRY(check_masks(head));
  if (!region.circle) return {};
  NODAL_TRY(in_range("region.circle.x", region.circle->x, -kMaxPlace, kMaxPlace));
  NODAL_TRY(in_range("region.circle.y", region.circle->y, -kMaxPlace, kMaxPlace));
  NODAL_TRY(in_range("region.circle.radius", region.circle->radius, 1, kMaxPlace));
  const double nearest_x = std::clamp(region.circle->x, region.left, region.right);
  const double nearest_y = std::clamp(region.circle->y, region.top, region.bottom);
  if (std::hypot(nearest_x - region.circle->x, nearest_y - region.circle->y) >= region.circle->radius) {
    return fail(Errc::kBadValue, "region.circle does not meet region's rectangle: nothing of the picture is left");
  }
  return {};
}

/// Every pixel of the region must have a unique angle, or be outside max_angle.
Status check_lens_covers_region(const HeadCalibration& head) {
  if (head.max_angle > 0) return {};
  const LensRange range = lens_range(head.lens);
  const double farthest = farthest_radius(head.region, head.center_x, head.center_y, head.aspect);
  if (farthest <= range.max_radius) return {};
  return fail(Errc::kLensDomain, std::string("the lens ") + (range.turns ? "has its largest radius" : "ends") + " at " +
                                     degrees(range.max_angle) + ", " + six_digits(range.max_radius) +
                                     " px from its centre, and the region reaches " + six_digits(farthest) +
                                     " px: set max_angle to less than " + six_digits(range.max_angle) +
                                     " rad, make the region smaller, or correct the lens");
}

Status check_response(const Response& response) {
  if (response.curve == Response::Curve::kGamma) return in_range("response.gamma", response.gamma, 0.1, 10);
  if (response.curve != Response::Curve::kPolynomial) return {};
  NODAL_TRY(check_count("response.coefficients", response.coefficients.size()));
  NODAL_TRY(coefficients_in_range("response.coefficients", response.coefficients));
  double sum = 0;
  for (const double c : response.coefficients) sum += c;
  if (!(std::abs(sum - 1) <= 1e-6)) {
    return fail(Errc::kBadValue, "response.coefficients sum to " + six_digits(sum) +
                                     "; they must sum to 1, so that full light is full value");
  }
  std::vector<double> whole{0.0};
  whole.insert(whole.end(), response.coefficients.begin(), response.coefficients.end());
  const double turn = rising_until(whole, 1.0);
  if (turn < 1) {
    return fail(Errc::kBadValue, "response.coefficients stop rising at an encoded value of " + six_digits(turn) +
                                     "; more light must always give more value, from 0 to 1");
  }
  return {};
}

Status check_vignetting(const HeadCalibration& head) {
  const Vignetting& v = head.vignetting;
  NODAL_TRY(in_range("vignetting.x", v.x, -kMaxPlace, kMaxPlace));
  NODAL_TRY(in_range("vignetting.y", v.y, -kMaxPlace, kMaxPlace));
  NODAL_TRY(in_range("vignetting.radius", v.radius, 1, kMaxPlace));
  NODAL_TRY(coefficients_in_range("vignetting.coefficients", v.coefficients));
  double reach = farthest_radius(head.region, v.x, v.y, head.aspect);
  if (head.max_angle > 0) {
    // Pixels beyond max_angle are not used, so the model may be invalid there.
    const double offset = std::hypot(v.x - head.center_x, (v.y - head.center_y) / head.aspect);
    reach = std::min(reach, lens_radius(head.lens, head.max_angle) + offset);
  }
  const std::array<double, 4> c{1, v.coefficients[0], v.coefficients[1], v.coefficients[2]};
  const double s = (reach / v.radius) * (reach / v.radius);
  const double darkest = polynomial_minimum(c, 0, s);
  if (darkest >= 0.01) return {};
  return fail(Errc::kBadValue, "vignetting falls to " + six_digits(darkest) +
                                   " of the light inside the region; below 0.01 nothing can be made up for: "
                                   "correct the coefficients or make the region smaller");
}

Status check_gain(const std::array<double, 3>& gain) {
  constexpr std::array kColours{"gain.red", "gain.green", "gain.blue"};
  for (std::size_t c = 0; c < 3; ++c) {
    NODAL_TRY(in_range(kColours[c], gain[c], 0.01, 100));
  }
  return {};
}

Status check_position(const std::array<double, 3>& position) {
  for (std::size_t k = 0; k < 3; ++k) {
    const std::string field = fmt::format("position[{}]", k);
    if (Status s = in_range(field, position[k], -kFarthestPosition, kFarthestPosition); !s) {
      return fail(s.error().code, s.error().message + " m from the rig's nodal point");
    }
  }
  return {};
}

/// Every head must be inside the sphere on which the pictures meet, and not close to it.
Status check_distance(const Calibration& calibration) {
  if (calibration.distance == 0) return {};
  if (!(calibration.distance > 0 && calibration.distance <= kLongestDistance)) {
    return fail(Errc::kBadValue, "distance is " + six_digits(calibration.distance) + " m; it must be above 0, up to " +
                                     six_digits(kLongestDistance) + "; leave it out for infinity");
  }
  const double farthest = farthest_position(calibration);
  if (farthest == 0) {
    return fail(Errc::kBadValue, "distance is " + six_digits(calibration.distance) +
                                     " m, but no head has a position, so it would change nothing; add each head's "
                                     "position, or leave distance out");
  }
  if (calibration.distance >= farthest * kMinDistancePerPosition) return {};
  return fail(Errc::kBadValue, "distance is " + six_digits(calibration.distance) + " m, and the farthest head is " +
                                   six_digits(farthest) + " m from the rig's nodal point; it must be at least " +
                                   six_digits(farthest * kMinDistancePerPosition) + " m");
}

/// The same rule as for names in rig.toml, so that the two can match.
bool is_name(std::string_view text) {
  const auto plain = [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '.' || c == '_' ||
           c == '-';
  };
  return !text.empty() && text.size() <= kMaxNameBytes && std::ranges::all_of(text, plain);
}

Status check_fields(const HeadCalibration& head) {
  NODAL_TRY(check_picture(head));
  NODAL_TRY(check_region(head));
  NODAL_TRY(check_lens(head.lens, head.max_angle));
  NODAL_TRY(check_lens_covers_region(head));
  NODAL_TRY(check_rotation(head.R_head_rig));
  NODAL_TRY(check_position(head.position));
  NODAL_TRY(check_response(head.response));
  NODAL_TRY(check_vignetting(head));
  return check_gain(head.gain);
}

}  // namespace

Status check_lens(const LensModel& lens, double max_angle) {
  NODAL_TRY(std::visit([](const auto& model) { return check_model(model); }, lens));
  const LensRange range = lens_range(lens);
  if (!(range.max_radius >= 1)) {
    return fail(Errc::kLensDomain,
                "the lens has its largest radius within a pixel of its centre: its coefficients are for another unit");
  }
  if (!(max_angle >= 0 && max_angle <= kPi)) {
    return fail(Errc::kBadValue,
                "max_angle is " + six_digits(max_angle) + " rad; it must be 0 (as far as the lens goes) to pi");
  }
  if (max_angle > range.max_angle + 1e-9) {
    return fail(Errc::kLensDomain, "max_angle is " + degrees(max_angle) + ", but the lens " +
                                       (range.turns ? "has its largest radius" : "ends") + " at " +
                                       degrees(range.max_angle) + ": set it to at most " + six_digits(range.max_angle) +
                                       " rad, or to 0");
  }
  return {};
}

Status check_head(const HeadCalibration& head) {
  if (!is_name(head.name)) {
    return fail(Errc::kBadValue, "a head's name must be 1 to 64 characters of A-Z a-z 0-9 . _ -");
  }
  Status checked = check_fields(head);
  if (!checked) return fail(checked.error().in("head '" + head.name + "'"));
  return checked;
}

Status check_calibration(const Calibration& calibration) {
  if (calibration.name.size() > kMaxTextBytes || calibration.comment.size() > kMaxTextBytes) {
    return fail(Errc::kTooLarge, "name and comment may have 65536 bytes each");
  }
  // Names are shown in logs and terminals. For the same reason the error does not repeat the name.
  if (!is_printable(calibration.name)) {
    return fail(Errc::kBadValue,
                "the calibration's name holds a control character, a line break or a bidirectional "
                "control; use letters, digits, spaces and punctuation only");
  }
  if (calibration.heads.size() < kMinHeads || calibration.heads.size() > kMaxCalibratedHeads) {
    return fail(Errc::kBadValue, fmt::format("the calibration has {} heads; it may have 1 to {}",
                                             calibration.heads.size(), kMaxCalibratedHeads));
  }
  for (std::size_t i = 0; i < calibration.heads.size(); ++i) {
    const HeadCalibration& head = calibration.heads[i];
    if (Status s = check_head(head); !s)
      return is_name(head.name) ? s : fail(s.error().in(fmt::format("heads[{}]", i)));
    for (std::size_t j = 0; j < i; ++j) {
      if (calibration.heads[j].name == head.name) {
        return fail(Errc::kBadValue,
                    fmt::format("heads[{}] and heads[{}] are both called '{}'; every head needs a name of its own", j,
                                i, head.name));
      }
    }
  }
  return check_distance(calibration);
}

double farthest_position(const Calibration& calibration) {
  double farthest = 0;
  for (const HeadCalibration& head : calibration.heads) {
    farthest = std::max(farthest, std::hypot(head.position[0], head.position[1], head.position[2]));
  }
  return farthest;
}

}  // namespace nodal
