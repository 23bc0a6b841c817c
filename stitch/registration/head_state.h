// The state of a head during registration: which of its parameters are estimated, and how a step changes them.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <vector>

#include "protocol/base/result.h"
#include "protocol/calibration.h"
#include "stitch/registration/mask_field.h"
#include "stitch/registration/radial_table.h"

namespace nodal::registration {

inline constexpr int kMaxSlots = 17;
inline constexpr int kVignettingTerms = 2;  ///< estimated terms; the third keeps its prior value

/// The index of each estimated parameter of a head among the kernel's derivatives; -1: not estimated.
struct Slots {
  int rotation = -1;  ///< three: the turn about the head's own axes, rad
  int focal = -1;     ///< log
  int center = -1;    ///< two, px
  int radial = -1;
  int radials = 0;
  int aspect = -1;    ///< shared by all heads
  int nearness = -1;  ///< shared by all heads, 1/m
  int gain = -1;      ///< log, one per channel
  int gains = 0;
  int vignetting = -1;  ///< kVignettingTerms
  int count = 0;
};

/// The parameters that are currently estimated.
struct Sought {
  bool rotation = true, focal = false, lens = false, aspect = false, nearness = false, gain = true, vignetting = true;
  int channels = 1;
};
Slots slots_of(const Sought& sought, int radials);

/// All parameters of one head that registration may change. A value.
struct HeadState {
  Eigen::Quaterniond q_head_rig{1, 0, 0, 0};
  LensModel lens;
  double center_x = 0, center_y = 0;
  double aspect = 1;    ///< height of a pixel's picture over its width, as in HeadCalibration
  double nearness = 0;  ///< 1 / Calibration::distance, 1/m; equal for all heads
  std::array<double, 3> log_gain{};
  std::array<double, 3> vignetting{};

  // Constant.
  Eigen::Vector3d position{0, 0, 0};          ///< m, in the rig frame
  double max_angle = 0;                       ///< the calibration's; 0: none
  double vignetting_x = 0, vignetting_y = 0;  ///< from the lens's centre
  double vignetting_radius = 1;
  Region region;
  std::shared_ptr<const MaskField> masks;  ///< null if nothing is masked
  double edge_radius = 1, edge_angle = 1;  ///< px and rad of the region's farthest point, at the start

  /// `distance`: Calibration::distance. Errors: kLensDomain.
  static Result<HeadState> from(const HeadCalibration& head, double distance = 0);
  /// The prior with this head's state.
  HeadCalibration into(HeadCalibration prior) const;
  /// The largest angle that is used of the lens: the region's farthest point or the lens's limit, rad.
  Result<double> used_angle() const;
  /// The angle by which the head's own position moves rays at most, rad.
  double parallax() const { return std::asin(std::min(1.0, position.norm() * nearness)); }
};

/// Bounds on the relative light at s = (radius / the fall-off's radius)^2. Lenses do not brighten their rims, and
/// without a lower bound, heads that do not match would be made similar by darkening everything that they share.
inline constexpr std::array<double, 4> kFallOffPlaces{0.25, 0.5, 0.75, 1.0};
inline constexpr double kMinLight = 0.05, kMaxLight = 1.01;
double light_left(const std::array<double, 3>& vignetting, double s);
bool plausible_fall_off(const std::array<double, 3>& vignetting);

/// `step` holds slots.count numbers. Changes of the fall-off are shortened so that it stays plausible.
HeadState moved(const HeadState& head, const Slots& slots, const Eigen::VectorXd& step);

/// Px per radian on the axis.
double focal_of(const LensModel& lens);

/// The largest distance of a point of the region from the lens's centre, px, before the aspect is applied.
double farthest_radius(const Region& region, double center_x, double center_y, double aspect);

}  // namespace nodal::registration
