// Virtual cameras that look into a raymap (§6).
#pragma once

#include <Eigen/Core>
#include <optional>
#include <string_view>

#include "protocol/base/result.h"
#include "stitch/geometry/ray.h"
#include "stitch/geometry/rotation.h"

namespace nodal::view {

/// How far from its centre, in focal lengths, a camera shows a ray at the angle a from its axis.
enum class Projection {
  kPerspective,    ///< tan a
  kFisheye,        ///< a
  kStereographic,  ///< 2 tan(a / 2)
  kEquisolid,      ///< 2 sin(a / 2)
};

/// "perspective", "fisheye", "stereographic", "equisolid". Errors: kBadValue, with the names.
Result<Projection> parse_projection(std::string_view text);

struct CameraSpec {
  Projection projection = Projection::kPerspective;
  geometry::YawPitchRoll pose;
  double fov_deg = 90;  ///< from the left to the right edge of the picture
  int width = 0;
  int height = 0;
};

/// Threading: immutable; any thread.
class Camera {
 public:
  /// Errors: kBadValue for a field of view that the projection cannot show (the message says what it can).
  static Result<Camera> make(const CameraSpec& spec);

  int width() const { return spec_.width; }
  int height() const { return spec_.height; }
  /// The ray, in the raymap's frame, of a point of the picture; pixel (i, j)'s centre is (i + .5, j + .5). Nothing beyond
  /// what the projection shows: a fisheye ends at 180 degrees from its axis.
  std::optional<geometry::Ray> ray(double x, double y) const;

 private:
  explicit Camera(const CameraSpec& spec);
  CameraSpec spec_;
  double focal_;  ///< px
  Eigen::Matrix3d R_rig_camera_;
};

}  // namespace nodal::view
