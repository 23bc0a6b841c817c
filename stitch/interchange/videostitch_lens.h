// The lenses of VideoStitch's inputs, as stitchEm computes them.
#pragma once

#include <Eigen/Core>
#include <array>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "protocol/base/result.h"
#include "protocol/calibration.h"
#include "stitch/interchange/head_fit.h"
#include "stitch/interchange/json_fields.h"
#include "stitch/interchange/panotools_head.h"

namespace nodal::interchange::videostitch {

/// One input's lens with the file's numbers.
struct Lens {
  RadialBasis basis = RadialBasis::kAngle;
  bool circle = false;
  double fx = 0, fy = 0;
  double a = 0, b = 0, c = 0;
  std::array<double, 2> tangential{};  ///< OpenCV's p1, p2
  std::array<double, 4> prism{};       ///< OpenCV's s1 to s4
  bool meters = false;                 ///< distortion is applied before the focal length, not after
  double unit = 1;                     ///< px; half the shorter side

  bool radial_only() const;
};

/// What an input says of lens and attitude; of curves over time their first values.
struct Geometry {
  Lens lens;
  double yaw = 0, pitch = 0, roll = 0, center_x = 0, center_y = 0;
  /// m: with its rotation R and the sphere's radius s, the head sees s R ray + translation.
  Eigen::Vector3d translation{0, 0, 0};
};

/// The first value of a curve over time: [type, frame, value, type, frame, value, ...]; of anything else the value
/// itself. Adds `name` to `changing` if there are several.
const nlohmann::json& first_value(const nlohmann::json& curve, std::string_view name, std::set<std::string>& changing);

/// Reads 'geometries', or the fields of an old project; `crop` is the part of the picture to which the field of view
/// refers.
/// Errors: kMissingField, kBadValue, kUnsupported, with the field.
Result<Geometry> read_geometry(const JsonFields& input, const Crop& crop, std::set<std::string>& changing,
                               FieldCheck& check);

/// Sets the head's lens; its region, centre and rotation must be set.
/// Errors: kLensDomain for a lens that does not rise.
Status set_lens(const Lens& lens, HeadCalibration& head, std::vector<std::string>& notes);

}  // namespace nodal::interchange::videostitch
