// Lens and poses as the calibration's unknowns: the point of the pattern's plane that a pixel shows, and its
// derivatives by every parameter.
#pragma once

#include <Eigen/Core>
#include <array>
#include <optional>
#include <string_view>
#include <vector>

#include "protocol/base/result.h"
#include "protocol/calibration.h"
#include "stitch/geometry/lens/rising_polynomial.h"
#include "stitch/geometry/ray.h"

namespace nodal::calibration {

enum class LensKind : std::uint8_t { kTsai, kEquidistant, kKannalaBrandt };

/// "tsai", "equidistant" or "kannala_brandt".
/// Errors: kBadValue; the message lists these names.
Result<LensKind> lens_kind_named(std::string_view name);

inline constexpr int kCenterX = 0, kCenterY = 1, kAspect = 2, kFirstCoefficient = 3;
inline constexpr int kMaxLensParameters = 12;

/// All unknowns of a lens in one vector: centre (px), aspect, then
///   Tsai:            focal, kappa1, kappa2
///   Equidistant:     f1, f2, ... of r = f1 a + f2 a^2 + ...
///   Kannala-Brandt:  f, f k1, ... of r = f a + f k1 a^3 + f k2 a^5 + ..., in which the fit is linear.
struct LensParameters {
  LensKind kind = LensKind::kTsai;
  int count = 6;
  std::array<double, kMaxLensParameters> values{0, 0, 1};

  double& operator[](int k) { return values[static_cast<std::size_t>(k)]; }
  double operator[](int k) const { return values[static_cast<std::size_t>(k)]; }
  /// The power of the angle (fisheyes) that coefficient k (0, 1, ...) multiplies.
  int exponent(int k) const { return kind == LensKind::kKannalaBrandt ? 2 * k + 1 : k + 1; }
  LensModel model() const;
};

/// The number of parameters of a lens kind, including centre and aspect.
int parameter_count(LensKind kind);

using ByParameter = Eigen::Matrix<double, 3, kMaxLensParameters>;

/// The ray of a pixel in the head's frame, of length 1, and its derivatives.
struct Sight {
  Eigen::Vector3d ray;
  Eigen::Matrix<double, 3, 2> by_pixel;
  ByParameter by_parameter;
};

/// Computes rays for one lens; its constants are computed once.
class SightFinder {
 public:
  explicit SightFinder(const LensParameters& lens);
  /// Nothing beyond the lens's turning point.
  std::optional<Sight> at(geometry::Pixel pixel) const;
  double max_radius() const;  ///< px, aspect taken out

 private:
  struct Angle {
    double value;
    double by_radius;
    std::array<double, kMaxLensParameters> by_coefficient;
  };
  std::optional<Angle> angle(double r) const;

  LensParameters lens_;
  geometry::RisingPolynomial polynomial_;
};

/// The pattern's pose in one photograph: point (X, Y) of the pattern's plane, in pattern widths from its centre, x
/// right and y down as printed, is at R (X, Y, 0) + t in the head's frame.
struct Pose {
  Eigen::Matrix3d R = Eigen::Matrix3d::Identity();
  Eigen::Vector3d t{0, 0, 1};

  /// The pose rotated by w about the head's origin and shifted by d; derivatives below are by w and d.
  Pose moved(const Eigen::Vector3d& w, const Eigen::Vector3d& d) const;
};

/// The point where a ray meets the plane.
struct PlanePoint {
  Eigen::Vector2d at;                   ///< pattern widths
  Eigen::Vector3d in_head;              ///< the same point in the head's frame
  double distance;                      ///< along the ray
  Eigen::Matrix<double, 2, 3> by_move;  ///< d at / d(shift of the ray's end point in the head's frame)
};

/// Intersects rays with one pose's plane; its constants are computed once.
class PlaneFinder {
 public:
  explicit PlaneFinder(const Pose& pose);
  /// Nothing if the ray misses the plane, or meets it from behind or at a grazing angle.
  std::optional<PlanePoint> at(const Eigen::Vector3d& ray) const;

 private:
  Eigen::Matrix3d inverse_;  // the inverse of (r1 r2 t)
  Eigen::Vector3d normal_;
};

}  // namespace nodal::calibration
