#include "stitch/table/head_optics.h"

#include <algorithm>
#include <cmath>

#include "stitch/table/head_sight.h"

namespace nodal::table {
namespace {

/// The largest angle of a point of the region from the axis.
double reach_of(const geometry::Head& head) {
  // 4 px more: ray interpolation reads the sample centres just outside the region.
  const double radius = std::min(radius_of_region(head) + 4, head.lens().max_radius());
  return head.lens().angle(radius).value_or(head.lens().max_angle());
}

}  // namespace

double radius_of_region(const geometry::Head& head) {
  const HeadCalibration& c = head.calibration();
  double radius = 0;
  for (const double x : {c.region.left, c.region.right}) {
    for (const double y : {c.region.top, c.region.bottom}) {
      radius = std::max(radius, std::hypot(x - c.center_x, (y - c.center_y) / c.aspect));
    }
  }
  return std::min(radius, head.lens().max_radius());
}

HeadOptics HeadOptics::of(const geometry::Head& head, PixelFormat raymap_format, double power,
                          const TableOptions& options) {
  const double full = options.transition == Transition::kFeather ? options.feather : 1;
  const double reach = reach_of(head);
  const Eigen::Matrix3d& R = head.R_head_rig();
  Response response = head.calibration().response;
  if (is_linear16(raymap_format))
    response = {Response::Curve::kGamma, power, {}};  // after the head's own response was undone
  HeadOptics optics{TabledLens(head.lens(), reach),
                    R.row(0),
                    R.row(1),
                    R.row(2),
                    std::cos(reach) - 1e-9,
                    1 / std::max(1e-3, half_of_region(head.calibration().region) * full),
                    EncodedGain(response)};
  if (!options.undo_gain) return optics;
  const std::array<double, 3>& gain = head.calibration().gain;
  if (in_8_bits(raymap_format) == PixelFormat::kRgb24) {
    for (std::size_t k = 0; k < 3; ++k) optics.gain[k] = optics.undo.undo(gain[k]);
  } else {
    // Y, U and V each mix all three colours, so a gain of one colour cannot be undone component by component. The mean
    // with the weights of luma keeps the brightness of grey correct.
    optics.gain.fill(optics.undo.undo(0.299 * gain[0] + 0.587 * gain[1] + 0.114 * gain[2]));
  }
  return optics;
}

}  // namespace nodal::table
