// Fits a head to pairs of ray and pixel, in a form that a program's format can hold; the residual is
// reported in pixels. All conversions between lens models use it.
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "protocol/base/result.h"
#include "protocol/calibration.h"
#include "stitch/geometry/ray.h"
#include "stitch/geometry/sampled_head.h"

namespace nodal::interchange {

/// What a radius is a polynomial of; a is the angle from the axis.
enum class RadialBasis { kAngle, kTangent, kHalfTangent };  ///< a, tan a, tan(a/2)
double radial_basis(RadialBasis basis, double angle);

/// u = cx + r x/s, v = cy + aspect r y/s, s = |(x, y)|, r = sum of coefficients[k] t^exponents[k].
struct PolynomialHead {
  RadialBasis basis = RadialBasis::kAngle;
  std::vector<int> exponents{1};
  std::vector<double> coefficients;
  double cx = 0, cy = 0, aspect = 1;
  Eigen::Matrix3d R_fitted_given = Eigen::Matrix3d::Identity();  ///< the turn from the given rays to the fitted head's
  double rms_px = 0;
  double max_px = 0;

  geometry::Pixel project(const Eigen::Vector3d& ray) const;
};

/// The unknowns of the fit.
struct FitFreedom {
  bool center = true;
  bool aspect = true;
  bool turn = false;  ///< the head's frame; for lenses whose shift is half a turn
};

/// Least squares over the pixels, from `start`'s centre and aspect. Rays that the basis cannot hold (90 degrees
/// from the axis and more, for tangents) are left out.
/// Errors: kBadValue when fewer than ten rays remain.
Result<PolynomialHead> fit_polynomial_head(const std::vector<geometry::RayPixel>& samples, const PolynomialHead& start,
                                           const FitFreedom& freedom);

/// The fitted numbers as a lens of the document. Bases of angles give EquidistantLens, or KannalaBrandtLens
/// when the exponents are odd and at most 9; tangents give RectilinearLens. Not for half tangents.
LensModel lens_of(const PolynomialHead& fit);

}  // namespace nodal::interchange
