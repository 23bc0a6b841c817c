// Virtual cameras that look into a raymap (§6).
#pragma once

#include <Eigen/Core>
#include <array>
#include <memory>
#include <optional>
#include <string_view>
#include <vector>

#include "protocol/base/result.h"
#include "stitch/geometry/ray.h"
#include "stitch/geometry/rotation.h"

namespace nodal::geometry {
class RisingPolynomial;
}

namespace nodal::view {

/// Where a camera shows a ray, in focal lengths from the picture's centre.
enum class Projection {
  // By the angle a between the ray and the axis: the distance r from the centre.
  kPerspective,    ///< r = tan a
  kFisheye,        ///< r = f1 a + f2 a^2 + ..., which is r = a when no coefficients are given
  kStereographic,  ///< r = 2 tan(a / 2)
  kEquisolid,      ///< r = 2 sin(a / 2)
  kOrthographic,   ///< r = sin a
  // By the ray's angles theta to the right and phi down (geometry::Angles): x to the right, y down. Verticals stay
  // straight.
  kPannini,            ///< x = S sin theta, y = S tan phi, where S = (d + 1) / (d + cos theta)
  kCylindrical,        ///< x = theta, y = tan phi
  kCylinderEqualArea,  ///< x = theta, y = sin phi
  kMercator,           ///< x = theta, y = asinh(tan phi)
  kEquirectangular,    ///< x = theta, y = phi
};

/// A projection with its parameters.
struct CameraName {
  Projection projection = Projection::kPerspective;
  /// Coefficients of kFisheye: f1 to f9, as those of an EquidistantLens. Only their ratios matter, because the field of
  /// view gives the focal length.
  std::array<double, 9> f{1};
  /// Parameter of kPannini: how far behind the axis of a cylinder of radius 1 the point is from which the cylinder is
  /// seen. 0 is perspective, 1 stereographic along the horizon.
  double d = 1;

  /// The least and the largest field of view, whole degrees. A fisheye's r must rise up to the largest.
  static constexpr int kMinFovDeg = 1;
  int widest_fov_deg() const;
};

/// The names of the projections, in the order of Projection.
std::vector<std::string_view> camera_names();

/// Parses "perspective", "fisheye", ...; "pannini:d=0.5", "fisheye:f1=1,f3=-0.05". Errors: kBadValue, which lists the
/// projections, or says how far r rises if it does not rise up to the least field of view.
Result<CameraName> parse_camera(std::string_view text);

struct CameraSpec {
  CameraName name;
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
  /// The ray, in the raymap's frame, of a point of the picture; pixel (i, j)'s centre is (i + .5, j + .5). Nothing
  /// beyond what the projection shows: a fisheye ends at 180 degrees from its axis, or where its r stops rising.
  std::optional<geometry::Ray> ray(double x, double y) const;

 private:
  explicit Camera(const CameraSpec& spec);
  CameraSpec spec_;
  /// Polynomial of a fisheye with f2 or more; null otherwise.
  std::shared_ptr<const geometry::RisingPolynomial> r_of_angle_;
  double focal_;  ///< px
  Eigen::Matrix3d R_rig_camera_;
};

}  // namespace nodal::view
