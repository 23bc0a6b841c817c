// Fits a head to pairs of ray and pixel, in a form that another program's format can hold; the residual is in pixels.
// All conversions between lens models use it.
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "protocol/base/result.h"
#include "protocol/calibration.h"
#include "stitch/geometry/ray.h"
#include "stitch/geometry/sampled_head.h"

namespace nodal::interchange {

/// The variable of the radius polynomial; a is the angle from the axis.
enum class RadialBasis { kAngle, kTangent, kHalfTangent };  ///< a, tan a, tan(a/2)
double radial_basis(RadialBasis basis, double angle);

/// u = cx + r x/s, v = cy + aspect r y/s, s = |(x, y)|, r = sum of coefficients[k] t^exponents[k].
struct PolynomialHead {
  RadialBasis basis = RadialBasis::kAngle;
  std::vector<int> exponents{1};
  std::vector<double> coefficients;
  double cx = 0, cy = 0, aspect = 1;
  Eigen::Matrix3d R_fitted_given = Eigen::Matrix3d::Identity();  ///< from the given rays' frame to the fitted head's
  double rms_px = 0;
  double max_px = 0;

  geometry::Pixel project(const Eigen::Vector3d& ray) const;
};

/// The unknowns of the fit besides the coefficients.
struct FitFreedom {
  bool center = true;
  bool aspect = true;
  bool turn = false;  ///< the head's frame; for lenses with a shift that is partly a rotation
};

/// Least squares over the pixels, starting from `start`'s centre and aspect. Rays that the basis cannot represent (for
/// tangents: 90 degrees or more from the axis) are left out.
/// Errors: kBadValue if fewer than ten rays remain.
Result<PolynomialHead> fit_polynomial_head(const std::vector<geometry::RayPixel>& samples, const PolynomialHead& start,
                                           const FitFreedom& freedom);

/// The fit as a lens of the document: for the basis of angles EquidistantLens, or KannalaBrandtLens if the exponents
/// are odd and at most 9; for tangents RectilinearLens. Not for half tangents.
LensModel lens_of(const PolynomialHead& fit);

}  // namespace nodal::interchange
