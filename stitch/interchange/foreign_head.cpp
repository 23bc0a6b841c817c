#include "stitch/interchange/foreign_head.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "protocol/base/angles.h"
#include "protocol/base/units.h"
#include "protocol/calibration_limits.h"
#include "protocol/lens_range.h"
#include "stitch/geometry/rotation.h"
#include "stitch/interchange/project.h"

namespace nodal::interchange {
namespace {

constexpr double kTellImportPx = 0.01;

}  // namespace

Result<int> picture_side(const Result<double>& value, const std::string& field) {
  if (!value) return fail(value.error());
  if (!(*value >= 1 && *value <= 32768)) return fail(Errc::kBadValue, field + " must be 1 to 32768 px");
  return static_cast<int>(*value);
}

void set_positions(std::span<const Eigen::Vector3d> positions, const std::string& how, ImportResult& result) {
  constexpr double kRounding = 1e-6;  // m
  double farthest = 0;
  for (const Eigen::Vector3d& position : positions) farthest = std::max(farthest, position.norm());
  if (!(farthest > kRounding)) {
    result.calibration.distance = 0;
    return;
  }
  for (std::size_t h = 0; h < positions.size(); ++h) {
    result.calibration.heads[h].position = {positions[h].x(), positions[h].y(), positions[h].z()};
  }
  const double distance = result.calibration.distance;
  const std::string meet = distance > 0 ? "The pictures meet at " + short_number(distance) + " m, as in the project"
                                        : "Without a distance they meet at infinity";
  result.notes.push_back("The cameras are up to " + short_number(farthest) + " m from the rig's nodal point (" + how +
                         "). " + meet +
                         ", and what is much nearer or farther doubles at the seams: `nodal register --free "
                         "distance` finds a distance in pictures, `nodal stitch --distance` takes one.");
}

HeadCalibration blank_head(const std::string& name, int width, int height) {
  HeadCalibration head;
  head.name = name;
  head.width = width;
  head.height = height;
  head.center_x = width / 2.0;
  head.center_y = height / 2.0;
  head.region = {0, 0, static_cast<double>(width), static_cast<double>(height), {}};
  head.vignetting = {head.center_x, head.center_y, std::hypot(width, height) / 2, {}};
  return head;
}

Status finish_head(HeadCalibration& head, std::vector<std::string>& notes) {
  const LensRange range = lens_range(head.lens);
  const double farthest = farthest_radius(head.region, head.center_x, head.center_y, head.aspect);
  const double end = head.max_angle > 0 ? std::min(head.max_angle, range.max_angle) : range.max_angle;
  const bool cut_already = head.max_angle > 0 && head.max_angle < range.max_angle;
  if (farthest > range.max_radius && range.max_radius >= 1 && !cut_already) {
    head.max_angle = range.turns ? 0.99 * end : end;
    notes.push_back("The lens of head '" + head.name + "' " + (range.turns ? "has its largest radius" : "ends") +
                    " at " + short_number(range.max_angle / kRadiansPerDegree) +
                    " degrees, inside the picture: the lens is used up to " +
                    short_number(head.max_angle / kRadiansPerDegree) + " degrees.");
  }
  return check_head(head);
}

void take_fit(const PolynomialHead& fit, const std::string& what_was_lost, HeadCalibration& head,
              std::vector<std::string>& notes) {
  head.lens = lens_of(fit);
  head.center_x = fit.cx;
  head.center_y = fit.cy;
  head.aspect = fit.aspect;
  head.R_head_rig = geometry::rows_of(fit.R_fitted_given * geometry::matrix_of(head.R_head_rig));
  tell_lens_fit(fit.rms_px, fit.max_px, what_was_lost, head, notes);
}

void tell_lens_fit(double rms_px, double max_px, const std::string& what_was_lost, const HeadCalibration& head,
                   std::vector<std::string>& notes) {
  if (max_px < kTellImportPx) return;
  notes.push_back("Head '" + head.name + "': " + what_was_lost + "; the lens nearest to it is off by " +
                  short_number(rms_px) + " px rms, " + short_number(max_px) + " px at most.");
}

Status check_head_count(std::size_t heads) {
  if (heads >= static_cast<std::size_t>(kMinHeads) && heads <= kMaxCalibratedHeads) return {};
  return fail(Errc::kUnsupported, fmt::format("it has {} cameras; a calibration has {} to {} heads", heads, kMinHeads,
                                              kMaxCalibratedHeads));
}

Status check_project_size(std::string_view text) {
  if (text.size() <= kMaxProjectBytes) return {};
  return fail(Errc::kTooLarge,
              fmt::format("it has {} bytes; a calibration has at most {}", text.size(), kMaxProjectBytes));
}

}  // namespace nodal::interchange
