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
/// If the calibration has a distance, rays of the rig end on the sphere of that radius, and the head sees their ends
/// from its own position.
///
/// Threading: immutable after make(); any thread.
/// Ownership: a value; it does not refer to the calibration.
class Head {
 public:
  /// `distance`: Calibration::distance, m; 0: infinity.
  /// Errors: those of check_head.
  static Result<Head> make(const HeadCalibration& calibration, double distance = 0);

  const std::string& name() const { return calibration_.name; }
  int width() const { return calibration_.width; }
  int height() const { return calibration_.height; }
  const HeadCalibration& calibration() const { return calibration_; }
  const Lens& lens() const { return lens_; }
  const Eigen::Matrix3d& R_head_rig() const { return R_head_rig_; }
  /// The head's position divided by the distance, in the rig frame; 0 at infinity.
  const Eigen::Vector3d& offset() const { return offset_; }
  /// The direction, from the head, of the end of a ray of the rig (a unit vector); a unit vector in the rig frame.
  Eigen::Vector3d seen_from_here(const Eigen::Vector3d& rig_ray) const {
    return offset_.isZero(0) ? rig_ray : Eigen::Vector3d((rig_ray - offset_).normalized());
  }
  /// By how much at most the angle between two rays of the rig grows, as seen from the head; 1 at infinity.
  double magnification() const { return 1 / (1 - offset_.norm()); }
  /// The reverse: the ray of the rig whose end the head sees in a direction.
  Eigen::Vector3d seen_from_rig(const Eigen::Vector3d& direction) const;
  /// The direction of the head's optical axis in the rig.
  Ray axis() const;

  /// The pixel of a ray of the rig; nothing beyond the lens's max_angle. The pixel may be outside the picture or the
  /// region: see contains().
  std::optional<Pixel> project(const Ray& rig_ray) const;
  /// The same, if the picture may be used there: contains(). Quick for rays that are far from the region.
  std::optional<Pixel> pixel_of(const Ray& rig_ray) const;
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
  Head(HeadCalibration calibration, Lens lens, const Eigen::Matrix3d& R_head_rig, const Eigen::Vector3d& offset);
  /// The vector from the lens's centre, with the aspect divided out.
  Eigen::Vector2d from_center(Pixel pixel) const;

  HeadCalibration calibration_;
  Lens lens_;
  Masks masks_;
  Eigen::Matrix3d R_head_rig_;
  Eigen::Vector3d offset_;
  double cos_reach_;  ///< rays with a smaller cosine to the axis are outside the region
};

/// HeadCalibration::position divided by Calibration::distance; 0 at infinity.
Eigen::Vector3d offset_of(const HeadCalibration& head, double distance);

/// Every head of a rig, in the document's order.
Result<std::vector<Head>> make_heads(const Calibration& calibration);

}  // namespace nodal::geometry
