// Kalibr's camchain.yaml: a chain of cameras. T_cn_cnm1 gives each camera's pose relative to the previous one,
// T_cam_imu relative to the inertial sensor.
#include <fmt/format.h>

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cmath>
#include <optional>

#include "protocol/base/angles.h"
#include "protocol/base/text.h"
#include "protocol/base/try.h"
#include "protocol/base/units.h"
#include "protocol/calibration_limits.h"
#include "stitch/geometry/rotation.h"
#include "stitch/interchange/foreign_head.h"
#include "stitch/interchange/import.h"
#include "stitch/interchange/known_fields.h"
#include "stitch/interchange/panotools_head.h"
#include "stitch/interchange/pinhole_lens.h"
#include "stitch/interchange/project.h"
#include "stitch/interchange/yaml_fields.h"

namespace nodal::interchange {
namespace {

/// A projection that is not a pinhole: r(a) in units of the focal length, before distortion.
struct Projection {
  std::string model;
  double first = 0, second = 0;  ///< xi | alpha, beta | xi, alpha

  double tangent(double a) const {
    const double s = std::sin(a), c = std::cos(a);
    if (model == "omni") return s / (c + first);
    if (model == "eucm") return s / (first * std::sqrt(second * s * s + c * c) + (1 - first) * c);
    if (model == "ds") {
      const double shifted = first + c;  // d1 = 1 for a unit ray
      return s / (second * std::sqrt(s * s + shifted * shifted) + (1 - second) * shifted);
    }
    return s / c;
  }
  std::size_t extra() const { return model == "omni" ? 1 : model == "pinhole" ? 0 : 2; }
};

Result<Projection> read_projection(const YamlFields& camera, std::vector<double>& intrinsics) {
  NODAL_TRY_ASSIGN(const std::string model, camera.text("camera_model"));
  Projection p{model};
  if (model != "pinhole" && model != "omni" && model != "eucm" && model != "ds") {
    return fail(Errc::kUnsupported, camera.where() + ": there is no camera_model '" + model +
                                        "' here; there are pinhole, omni, eucm and ds");
  }
  NODAL_TRY_ASSIGN(std::vector<double> numbers, camera.numbers("intrinsics"));
  if (numbers.size() != 4 + p.extra()) {
    return fail(Errc::kBadValue,
                fmt::format("{}: 'intrinsics' must hold {} numbers for {}", camera.where(), 4 + p.extra(), model));
  }
  if (p.extra() > 0) p.first = numbers[0];
  if (p.extra() > 1) p.second = numbers[1];
  intrinsics.assign(numbers.end() - 4, numbers.end());
  return p;
}

Status set_lens(const YamlFields& camera, HeadCalibration& head, std::vector<std::string>& notes) {
  std::vector<double> intrinsics;
  NODAL_TRY_ASSIGN(const Projection projection, read_projection(camera, intrinsics));
  const PinholeNumbers pinhole{intrinsics[0], intrinsics[1], intrinsics[2], intrinsics[3]};
  NODAL_TRY_ASSIGN(const std::string model, camera.text("distortion_model"));
  std::vector<double> k;
  if (model != "none") {
    NODAL_TRY_ASSIGN(const std::vector<double> given, camera.numbers("distortion_coeffs"));
    k = given;
  }
  const bool pure = projection.model == "pinhole";
  if (pure && model == "equidistant") return set_kannala_brandt(pinhole, k, head);
  if (pure && (model == "radtan" || model == "none")) return set_plumb_bob(pinhole, {k}, head, notes);
  if (pure && model == "fov") {
    if (k.empty() || !(k[0] > 0.01 && k[0] < 3)) {
      return fail(Errc::kBadValue, camera.where() + ": the fov model has one coefficient, 0.01 to 3");
    }
    const double w = k[0];
    return set_radial(
        pinhole, [w](double a) { return std::atan(2 * std::tan(a) * std::tan(w / 2)) / w; }, 89 * kPi / 180,
        "its fov distortion", head, notes);
  }
  if (!pure && (model == "radtan" || model == "none")) {
    const PlumbBob bob{k};
    if (k.size() > 3 && (k[2] != 0 || k[3] != 0)) {
      notes.push_back("Head '" + head.name + "': the tangential terms of its " + projection.model +
                      " lens have no counterpart here and are left out.");
    }
    PlumbBob radial = bob;
    for (std::size_t i = 2; i < std::min<std::size_t>(4, radial.k.size()); ++i) radial.k[i] = 0;
    const Projection& p = projection;
    return set_radial(
        pinhole,
        [p, radial](double a) {
          return radial.bend({p.tangent(a), 0}).x();
        },
        0.95 * kPi, "its " + p.model + " projection", head, notes);
  }
  return fail(Errc::kUnsupported, camera.where() + ": there is no " + projection.model + " with distortion_model '" +
                                      model + "' here; there are radtan, equidistant, fov and none");
}

/// From another frame to a camera's: x_camera = R x + shift.
struct Placement {
  Eigen::Matrix3d R = Eigen::Matrix3d::Identity();
  Eigen::Vector3d shift = Eigen::Vector3d::Zero();  ///< m

  Placement inverse() const { return {R.transpose(), -(R.transpose() * shift)}; }
  Placement after(const Placement& first) const { return {R * first.R, R * first.shift + shift}; }
};

/// Nothing if the camera does not have it.
Result<std::optional<Placement>> read_placement(const YamlFields& camera, const std::string& key) {
  if (!camera.has(key)) return std::optional<Placement>();
  NODAL_TRY_ASSIGN(const std::vector<double> T, camera.matrix(key, 4, 4));
  Eigen::Matrix3d R;
  for (Eigen::Index i = 0; i < 3; ++i) {
    for (Eigen::Index k = 0; k < 3; ++k) R(i, k) = T[static_cast<std::size_t>(4 * i + k)];
  }
  constexpr double kWritten = 1e-4;
  const Result<Eigen::Matrix3d> rotation = geometry::nearest_rotation(R, kWritten);
  if (!rotation) return fail(rotation.error().in(camera.where() + ": " + key));
  return std::optional<Placement>(Placement{*rotation, {T[3], T[7], T[11]}});
}

/// The cameras' places in the frame of the first one, one after another.
class Places {
 public:
  /// Errors: those of the fields.
  Status add(const YamlFields& camera) {
    NODAL_TRY_ASSIGN(const std::optional<Placement> step, read_placement(camera, "T_cn_cnm1"));
    NODAL_TRY_ASSIGN(std::optional<Placement> by_imu, read_placement(camera, "T_cam_imu"));
    if (!by_imu) {
      NODAL_TRY_ASSIGN(const std::optional<Placement> inverse, read_placement(camera, "T_imu_cam"));
      if (inverse) by_imu = inverse->inverse();
    }
    if (all_.empty()) {
      first_by_imu_ = by_imu;
      all_.emplace_back();
      return {};
    }
    const std::optional<Placement> from_imu =
        first_by_imu_ && by_imu ? std::optional<Placement>(by_imu->after(first_by_imu_->inverse())) : std::nullopt;
    if (!step && !from_imu) unplaced_.push_back(camera.where());
    all_.push_back(step ? step->after(all_.back()) : from_imu.value_or(Placement{}));
    constexpr double kAgree = 1;  // degrees
    if (step && from_imu) {
      const double apart = Eigen::AngleAxisd(from_imu->R * all_.back().R.transpose()).angle() / kRadiansPerDegree;
      if (apart > kAgree) contradictions_.push_back(camera.where());
    }
    return {};
  }

  const Placement& last() const { return all_.back(); }
  void tell(std::vector<std::string>& notes) const {
    if (!unplaced_.empty()) {
      notes.push_back("The file does not say how " + listed(unplaced_) +
                      " stands to cam0 (no T_cn_cnm1, no T_cam_imu of both): it looks forward; place the heads with "
                      "`nodal pairs`, then `nodal register`.");
    }
    if (!contradictions_.empty()) {
      notes.push_back("T_cn_cnm1 and T_cam_imu contradict each other by more than a degree at " +
                      listed(contradictions_) + ": T_cn_cnm1 is used.");
    }
  }

 private:
  static std::string listed(const std::vector<std::string>& names) {
    std::string text;
    for (const std::string& name : names) text += (text.empty() ? "" : ", ") + name;
    return text;
  }
  std::vector<Placement> all_;
  std::optional<Placement> first_by_imu_;
  std::vector<std::string> unplaced_, contradictions_;
};

/// Whether a name is that of a camera: cam0, cam1 and so on.
bool is_camera(const std::string& name) {
  return name.size() > 3 && name.starts_with("cam") && name.find_first_not_of("0123456789", 3) == std::string::npos;
}

/// Compares the fields of the chain and its cameras with the table.
/// Errors: kBadValue for a camera behind a gap in the numbers.
Status check_chain_fields(const YAML::Node& root, std::size_t cameras, std::vector<std::string>& notes) {
  FieldCheck check(kalibr_fields());
  for (const auto& member : root) {
    if (!member.first.IsScalar()) continue;
    const std::string name = member.first.Scalar();
    check.see("chain", is_camera(name) ? "camN" : name, "");
    if (!is_camera(name)) continue;
    see_members(member.second, "camera", name, check);
    if (name.size() > 6 || std::stoul(name.substr(3)) >= cameras) {
      return fail(Errc::kBadValue,
                  fmt::format("there is a '{}', and no 'cam{}': cameras are counted from cam0 without a gap",
                              printable(name, 40), cameras));
    }
  }
  return check.tell(notes);
}

/// The camera's name from its topic (/NAME/image_raw); without a topic, its number in the chain.
std::string name_of(const YamlFields& camera, const std::string& number, const ImportResult& result) {
  std::vector<std::string> taken;
  for (const HeadCalibration& head : result.calibration.heads) taken.push_back(head.name);
  const Result<std::string> topic = camera.text("rostopic");
  if (!topic) return head_name(number + ".", taken);
  const std::size_t first = topic->find_first_not_of('/');
  if (first == std::string::npos) return head_name(number + ".", taken);
  return head_name(topic->substr(first, topic->find('/', first) - first) + ".", taken);
}

}  // namespace

Result<ImportResult> import_kalibr(std::string_view text, std::string_view name) {
  NODAL_TRY_ASSIGN(const YAML::Node root, parse_foreign_yaml(text));
  const YamlFields chain(root, "the chain");
  ImportResult result;
  result.calibration.name = std::string(name);
  result.calibration.comment = "Imported from a Kalibr camera chain.";
  Places places;
  std::vector<Eigen::Vector3d> positions;  // positions in the first camera's frame
  Eigen::Vector3d middle = Eigen::Vector3d::Zero();
  for (std::size_t n = 0; n <= kMaxCalibratedHeads && chain.has(fmt::format("cam{}", n)); ++n) {
    const std::string camera_name = fmt::format("cam{}", n);
    const YamlFields camera(chain.at(camera_name), camera_name);
    NODAL_TRY_ASSIGN(const std::vector<double> resolution, camera.numbers("resolution"));
    if (resolution.size() != 2 || !(resolution[0] >= 1 && resolution[0] <= 32768) ||
        !(resolution[1] >= 1 && resolution[1] <= 32768)) {
      return fail(Errc::kBadValue, camera_name + ": 'resolution' must be two numbers of 1 to 32768");
    }
    HeadCalibration head = blank_head(name_of(camera, camera_name, result), static_cast<int>(resolution[0]),
                                      static_cast<int>(resolution[1]));
    NODAL_TRY(places.add(camera));
    const Eigen::Matrix3d& R_head_rig = places.last().R;
    positions.emplace_back(-(R_head_rig.transpose() * places.last().shift));
    middle += positions.back();
    head.R_head_rig = geometry::rows_of(*geometry::nearest_rotation(R_head_rig));
    NODAL_TRY(set_lens(camera, head, result.notes));
    NODAL_TRY(finish_head(head, result.notes));
    result.calibration.heads.push_back(std::move(head));
    result.images.emplace_back();
  }
  if (result.calibration.heads.empty()) {
    return fail(Errc::kMissingField, "there is no 'cam0' in it: it is not a Kalibr camera chain");
  }
  NODAL_TRY(check_head_count(result.calibration.heads.size()));
  NODAL_TRY(check_chain_fields(root, result.calibration.heads.size(), result.notes));
  places.tell(result.notes);
  middle /= static_cast<double>(positions.size());
  for (Eigen::Vector3d& position : positions) position -= middle;
  set_positions(positions, "the rig's nodal point is the cameras' mean", result);
  NODAL_TRY(check_calibration(result.calibration));
  return result;
}

}  // namespace nodal::interchange
