// Facebook's Surround360 and facebook360_dep rigs. Pixel corners are at integers, as in Nodal; a camera looks along its
// `forward`; the world has x forward, y left, z up.
#include <fmt/format.h>

#include <Eigen/Core>
#include <cmath>

#include "protocol/base/angles.h"
#include "protocol/base/try.h"
#include "protocol/lens_range.h"
#include "stitch/geometry/rotation.h"
#include "stitch/interchange/foreign_head.h"
#include "stitch/interchange/import.h"
#include "stitch/interchange/json_fields.h"
#include "stitch/interchange/known_fields.h"
#include "stitch/interchange/panotools_head.h"
#include "stitch/interchange/project.h"

namespace nodal::interchange {
namespace {

constexpr double kWidestRigInMetres = 2;

/// Converts a direction of that world to the rig's axes: x right, y down, z forward.
Eigen::Vector3d to_rig(const std::vector<double>& v) { return {-v[1], -v[2], v[0]}; }

/// The rotation from the three axes in the file.
Status read_rotation(const JsonFields& camera, HeadCalibration& head) {
  std::array<Eigen::Vector3d, 3> axes;  // right, up, forward
  constexpr std::array kNames{"right", "up", "forward"};
  for (std::size_t k = 0; k < 3; ++k) {
    NODAL_TRY_ASSIGN(const std::vector<double> axis, camera.numbers(kNames[k], 3, 3));
    axes[k] = to_rig(axis);
  }
  Eigen::Matrix3d R;
  R << axes[0].transpose(), -axes[1].transpose(), axes[2].transpose();
  constexpr double kWritten = 1e-3;  // some rigs are rounded to four digits
  const Result<Eigen::Matrix3d> rotation = geometry::nearest_rotation(R, kWritten);
  if (!rotation) return fail(rotation.error().in(camera.where() + ": right, up, forward"));
  head.R_head_rig = geometry::rows_of(*rotation);
  return {};
}

/// distort(s) = s + d0 s^3 + d1 s^5 (+ d2 s^7), with s by the camera's type; radius = focal * distort(s).
Status read_lens(const JsonFields& camera, HeadCalibration& head, std::vector<std::string>& notes) {
  NODAL_TRY_ASSIGN(const std::vector<double> focal, camera.numbers("focal", 2, 2));
  if (!(focal[0] > 0 && focal[1] < 0)) {
    return fail(Errc::kBadValue, camera.where() + ": the field 'focal' must be a positive and a negative number");
  }
  const double f = focal[0];
  head.aspect = -focal[1] / f;
  std::vector<double> d{0, 0, 0};
  if (camera.has("distortion")) {
    NODAL_TRY_ASSIGN(const std::vector<double> given, camera.numbers("distortion", 1, 3));
    std::copy(given.begin(), given.end(), d.begin());
  }
  NODAL_TRY_ASSIGN(const std::string type, camera.text("type"));
  if (type == "FTHETA") {
    head.lens = KannalaBrandtLens{f, {d[0], d[1], d[2], 0}};
    return {};
  }
  if (type == "RECTILINEAR") {
    head.lens = RectilinearLens{{f, 0, f * d[0], 0, f * d[1], 0, f * d[2]}};
    return {};
  }
  if (type != "EQUISOLID" && type != "ORTHOGRAPHIC") {
    return fail(Errc::kUnsupported, camera.where() + ": there is no lens type '" + type +
                                        "' here; there are FTHETA, "
                                        "RECTILINEAR, EQUISOLID and ORTHOGRAPHIC");
  }
  const bool equisolid = type == "EQUISOLID";
  const auto radius = [&](double a) {
    const double s = equisolid ? 2 * std::sin(a / 2) : std::sin(a);
    return f * s * (1 + s * s * (d[0] + s * s * (d[1] + s * s * d[2])));
  };
  // Up to the angle that the rig states, else up to the picture's farthest corner.
  double end = head.max_angle > 0 ? head.max_angle : kPi / 2;
  const double corner = std::hypot(std::max(head.center_x, head.width - head.center_x),
                                   std::max(head.center_y, head.height - head.center_y) / head.aspect);
  while (equisolid && head.max_angle == 0 && end < 0.95 * kPi && radius(end) < corner) end += 0.01;
  std::vector<geometry::RayPixel> samples;
  for (int i = 1; i <= 400; ++i) {
    const double a = end * i / 400;
    samples.push_back({{std::sin(a), 0, std::cos(a)}, {radius(a), 0}});
  }
  PolynomialHead start;
  start.exponents = {1, 3, 5, 7, 9};
  const Result<PolynomialHead> fit = fit_polynomial_head(samples, start, {false, false, false});
  if (!fit) return fail(fit.error().in(camera.where()));
  head.lens = lens_of(*fit);
  notes.push_back("Head '" + head.name + "': its lens type " + type + " is fitted by a Kannala-Brandt lens, off by " +
                  short_number(fit->rms_px) + " px rms, " + short_number(fit->max_px) + " px at most.");
  return {};
}

Result<HeadCalibration> read_camera(const nlohmann::json& json, std::size_t index, ImportResult& result) {
  const JsonFields unnamed(json, fmt::format("camera {}", index));
  NODAL_TRY_ASSIGN(const std::string id, unnamed.text("id"));
  const JsonFields camera(json, "camera '" + id + "'");
  NODAL_TRY_ASSIGN(const std::vector<double> resolution, camera.numbers("resolution", 2, 2));
  for (const double side : resolution) {
    if (side >= 1 && side <= 32768) continue;
    return fail(Errc::kBadValue, camera.where() + ": the field 'resolution' must be 1 to 32768 px");
  }
  std::vector<std::string> taken;
  for (const HeadCalibration& head : result.calibration.heads) taken.push_back(head.name);
  HeadCalibration head =
      blank_head(head_name(id + ".", taken), static_cast<int>(resolution[0]), static_cast<int>(resolution[1]));
  if (camera.has("principal")) {
    NODAL_TRY_ASSIGN(const std::vector<double> principal, camera.numbers("principal", 2, 2));
    head.center_x = principal[0];
    head.center_y = principal[1];
  }
  NODAL_TRY_ASSIGN(const double fov, camera.number_or("fov", 0));
  if (fov > 0 && fov < kPi) head.max_angle = fov;
  NODAL_TRY(read_rotation(camera, head));
  NODAL_TRY(read_lens(camera, head, result.notes));
  const LensRange range = lens_range(head.lens);
  if (head.max_angle >= range.max_angle) head.max_angle = 0;  // the lens ends at a smaller angle than the file states
  NODAL_TRY(finish_head(head, result.notes));
  return head;
}

}  // namespace

Result<ImportResult> import_surround360(std::string_view text, std::string_view name) {
  NODAL_TRY_ASSIGN(const nlohmann::json json, parse_foreign_json(text));
  const JsonFields rig(json, "the rig");
  if (!rig.has("cameras") || !rig["cameras"].is_array()) {
    return fail(Errc::kMissingField, "there is no list 'cameras' in it: it is not a Surround360 rig");
  }
  const nlohmann::json& cameras = rig["cameras"];
  NODAL_TRY(check_head_count(cameras.size()));
  ImportResult result;
  result.calibration.name = std::string(name);
  result.calibration.comment = "Imported from a Surround360 rig.";
  FieldCheck check(surround360_fields());
  see_members(json, "rig", "", check);
  std::vector<Eigen::Vector3d> origins;
  for (std::size_t i = 0; i < cameras.size(); ++i) {
    NODAL_TRY_ASSIGN(HeadCalibration head, read_camera(cameras[i], i, result));
    result.calibration.heads.push_back(std::move(head));
    result.images.emplace_back();
    const JsonFields camera(cameras[i], "camera '" + result.calibration.heads.back().name + "'");
    see_members(cameras[i], "camera", camera.where(), check);
    origins.emplace_back(Eigen::Vector3d::Zero());
    if (!camera.has("origin")) continue;
    NODAL_TRY_ASSIGN(const std::vector<double> origin, camera.numbers("origin", 3, 3));
    origins.back() = to_rig(origin);
  }
  double farthest = 0;
  for (const Eigen::Vector3d& origin : origins) farthest = std::max(farthest, origin.norm());
  // The format has no unit: Facebook's cameras are written in centimetres, later rigs in metres.
  const bool centimetres = farthest > kWidestRigInMetres;
  for (Eigen::Vector3d& origin : origins) origin *= centimetres ? 0.01 : 1;
  set_positions(origins, "the file's unit is taken for " + std::string(centimetres ? "centimetres" : "metres"), result);
  NODAL_TRY(check.tell(result.notes));
  NODAL_TRY(check_calibration(result.calibration));
  return result;
}

}  // namespace nodal::interchange
