// A head as registration moves it: what is sought of it, and how a step of the sought numbers changes it.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <array>
#include <memory>
#include <vector>

#include "protocol/base/result.h"
#include "protocol/calibration.h"
#include "stitch/registration/mask_field.h"
#include "stitch/registration/radial_table.h"

namespace nodal::registration {

inline constexpr int kMaxSlots = 16;
inline constexpr int kVignettingTerms = 2;  ///< that are sought; the third stays the prior's

/// Where each sought number of a head is among the numbers the kernel takes derivatives by; -1: not sought.
struct Slots {
  int rotation = -1;  ///< three: the turn about the head's own axes, rad
  int focal = -1;     ///< log
  int center = -1;    ///< two, px
  int radial = -1;
  int radials = 0;
  int gain = -1;  ///< log, one a channel
  int gains = 0;
  int vignetting = -1;  ///< kVignettingTerms
  int count = 0;
};

/// What is sought at the moment.
struct Sought {
  bool rotation = true, focal = false, lens = false, gain = true, vignetting = true;
  int channels = 1;
};
Slots slots_of(const Sought& sought, int radials);

/// Everything registration may change of one head. A value.
struct HeadState {
  Eigen::Quaterniond q_head_rig{1, 0, 0, 0};
  LensModel lens;
  double center_x = 0, center_y = 0;
  std::array<double, 3> log_gain{};
  std::array<double, 3> vignetting{};

  // What stays.
  double aspect = 1;
  double max_angle = 0;                       ///< of the document; 0: none
  double vignetting_x = 0, vignetting_y = 0;  ///< from the lens's centre
  double vignetting_radius = 1;
  Region region;
  std::shared_ptr<const MaskField> masks;  ///< null where nothing is masked
  double edge_radius = 1, edge_angle = 1;  ///< the farthest place of the region at the start

  /// Errors: kLensDomain.
  static Result<HeadState> from(const HeadCalibration& head);
  /// The prior with this in it.
  HeadCalibration into(HeadCalibration prior) const;
  /// How far the lens is used now: the region's farthest place or the lens's end, rad.
  Result<double> used_angle() const;
};

/// What is left of the light at the places s = (radius / the fall-off's)^2 must be between these: lenses do not brighten
/// their rims, and heads that differ by more than light would be made alike by calling all that they share dark.
inline constexpr std::array<double, 4> kFallOffPlaces{0.25, 0.5, 0.75, 1.0};
inline constexpr double kLeastLight = 0.05, kMostLight = 1.01;
double light_left(const std::array<double, 3>& vignetting, double s);
bool plausible_fall_off(const std::array<double, 3>& vignetting);

/// `step` holds slots.count numbers. A fall-off goes only as far as it stays plausible.
HeadState moved(const HeadState& head, const Slots& slots, const Eigen::VectorXd& step);

/// Px a radian on the axis.
double focal_of(const LensModel& lens);

/// Farthest distance of a place in the region from the lens's centre, px, aspect taken out.
double farthest_radius(const Region& region, double center_x, double center_y, double aspect);

}  // namespace nodal::registration
