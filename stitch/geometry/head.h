// A head of the rig: from rays of the rig to pixels of its picture, and back (§4.1).
#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "protocol/base/result.h"
#include "protocol/calibration.h"
#include "stitch/geometry/lens/lens.h"
#include "stitch/geometry/masks.h"
#include "stitch/geometry/ray.h"

namespace nodal::geometry {

/// A pixel and its derivative by the ray in the rig frame: d(pixel) = J d(ray), in px per unit of the ray's
/// (tangential) change.
struct Projection {
  Pixel pixel;
  Eigen::Matrix<double, 2, 3> J;
};

/// One camera C_i: lens, orientation, region, radiometry. With (x, y, z) a ray in the head's frame, a its angle from
/// the axis and psi its direction around the axis:  u = c_x + r(a) cos psi,  v = c_y + a_y r(a) sin psi.
///
/// Threading: immutable after make(); any thread.
/// Ownership: a value; it does not refer to the calibration.
class Head {
 public:
  /// Errors: those of check_head.
  static Result<Head> make(const HeadCalibration& calibration);

  const std::string& name() const { return calibration_.name; }
  int width() const { return calibration_.width; }
  int height() const { return calibration_.height; }
  const HeadCalibration& calibration() const { return calibration_; }
  const Lens& lens() const { return lens_; }
  const Eigen::Matrix3d& R_head_rig() const { return R_head_rig_; }
  /// The head's optical axis in the rig.
  Ray axis() const;

  /// The pixel of a ray of the rig; nothing beyond the lens's max_angle. The pixel may be outside the picture or the
  /// region: see contains().
  std::optional<Pixel> project(const Ray& rig_ray) const;
  std::optional<Projection> project_with_jacobian(const Ray& rig_ray) const;
  /// The ray of the rig that a point of the picture receives; nothing beyond the lens's max_radius.
  std::optional<Ray> unproject(Pixel pixel) const;

  /// Whether the point may be used: inside the region, not masked, and within the lens's max_angle.
  bool contains(Pixel pixel) const { return distance_to_edge(pixel) >= 0; }
  /// The distance of a point from the border of the area that contains() accepts, px; negative outside.
  double distance_to_edge(Pixel pixel) const;
  double distance_to_edge_without_masks(Pixel pixel) const;
  const Masks& masks() const { return masks_; }

  /// Original pixels per steradian at the point, a_y r r' / sin a: how precise the head is there (§4.2, in its intended
  /// form). 0 beyond the lens's max_radius.
  double density(Pixel pixel) const;

  /// V at the point, as in the calibration document; 1 without vignetting.
  double vignetting(Pixel pixel) const;

 private:
  Head(HeadCalibration calibration, Lens lens, const Eigen::Matrix3d& R_head_rig);
  /// The vector from the lens's centre, with the aspect divided out.
  Eigen::Vector2d from_center(Pixel pixel) const;

  HeadCalibration calibration_;
  Lens lens_;
  Masks masks_;
  Eigen::Matrix3d R_head_rig_;
};

/// Every head of a rig, in the document's order.
Result<std::vector<Head>> make_heads(const Calibration& calibration);

}  // namespace nodal::geometry
