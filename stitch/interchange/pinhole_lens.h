// The distortion models of OpenCV and Kalibr, converted to the nearest head.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "protocol/base/result.h"
#include "protocol/calibration.h"
#include "stitch/interchange/head_fit.h"

namespace nodal::interchange {

/// Focal lengths and principal point in those programs' convention: px, pixel centres at integers.
struct PinholeNumbers {
  double fx = 0, fy = 0, cx = 0, cy = 0;
};

/// OpenCV's k1 k2 p1 p2 [k3 [k4 k5 k6 [s1 s2 s3 s4]]]; 0, 2, 4, 5, 8 or 12 numbers ("radtan" is 4 of them):
///   x'' = x' (1 + k1 r^2 + k2 r^4 + k3 r^6) / (1 + k4 r^2 + k5 r^4 + k6 r^6) + tangential + prism
struct PlumbBob {
  std::vector<double> k;
  Eigen::Vector2d bend(const Eigen::Vector2d& ideal) const;
};

/// Sets head.lens, centre and aspect. Radial polynomials are converted exactly. Rational and tangential terms are
/// fitted over the picture, up to where the distortion turns back, and the residual is noted.
/// Errors: kBadValue for invalid numbers, kUnsupported for another number of coefficients.
Status set_plumb_bob(const PinholeNumbers& pinhole, const PlumbBob& bob, HeadCalibration& head,
                     std::vector<std::string>& notes);

/// OpenCV's fisheye model and Kalibr's "equidistant"; exact.
Status set_kannala_brandt(const PinholeNumbers& pinhole, const std::vector<double>& k, HeadCalibration& head);

/// Any radial projection r = f(a), in units of fx, up to `end` rad; fitted by a Kannala-Brandt lens.
Status set_radial(const PinholeNumbers& pinhole, const std::function<double(double)>& radius, double end,
                  const std::string& what, HeadCalibration& head, std::vector<std::string>& notes);

}  // namespace nodal::interchange
