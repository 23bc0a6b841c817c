#include "stitch/interchange/head_fit.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "stitch/geometry/rotation.h"
#include "stitch/solve/levenberg_marquardt.h"

namespace nodal::interchange {
namespace {

constexpr int kSteps = 25;
constexpr int kMaxRefusals = 3;     // steps are nearly exact; repeated refusals mean only rounding is left
constexpr double kEnough = 1e-14;   // share of the cost
constexpr double kDamping = 1e-13;  // powers of an angle are nearly dependent: keeps pivots positive
constexpr double kMaxTangentAngle = 89.5 * std::numbers::pi / 180;
constexpr int kPlace = 6;  // cx, cy, aspect and three rotation angles precede the coefficients

bool reaches(RadialBasis basis, double angle) {
  if (basis == RadialBasis::kTangent) return angle < kMaxTangentAngle;
  return angle < 0.999 * std::numbers::pi;
}

double angle_of(const Eigen::Vector3d& ray) { return std::atan2(std::hypot(ray.x(), ray.y()), ray.z()); }

double power(double t, int n) {
  double value = 1;
  for (; n > 0; --n) value *= t;
  return value;
}

double radius_at(const PolynomialHead& head, double angle) {
  const double t = radial_basis(head.basis, angle);
  double r = 0;
  for (std::size_t k = 0; k < head.exponents.size(); ++k) r += head.coefficients[k] * power(t, head.exponents[k]);
  return r;
}

/// Derivatives of (u, v) by all unknowns, px; by the rotation only if requested.
Eigen::Matrix<double, 2, Eigen::Dynamic> derivatives(const PolynomialHead& head, const Eigen::Vector3d& given,
                                                     bool by_turn) {
  const auto n = static_cast<Eigen::Index>(kPlace + head.exponents.size());
  Eigen::Matrix<double, 2, Eigen::Dynamic> J = Eigen::Matrix<double, 2, Eigen::Dynamic>::Zero(2, n);
  const Eigen::Vector3d ray = head.R_fitted_given * given;
  const double s = std::hypot(ray.x(), ray.y());
  const Eigen::Vector2d e = s > 0 ? Eigen::Vector2d(ray.x() / s, ray.y() / s) : Eigen::Vector2d::Zero();
  const double t = radial_basis(head.basis, angle_of(ray));
  J(0, 0) = 1;
  J(1, 1) = 1;
  J(1, 2) = e.y() * radius_at(head, angle_of(ray));
  for (int k = 0; by_turn && k < 3; ++k) {
    constexpr double kStep = 1e-6;
    PolynomialHead turned = head;
    turned.R_fitted_given = geometry::rotation_about(kStep * Eigen::Vector3d::Unit(k)) * head.R_fitted_given;
    const geometry::Pixel more = turned.project(given);
    turned.R_fitted_given = geometry::rotation_about(-kStep * Eigen::Vector3d::Unit(k)) * head.R_fitted_given;
    const geometry::Pixel less = turned.project(given);
    J(0, 3 + k) = (more.x - less.x) / (2 * kStep);
    J(1, 3 + k) = (more.y - less.y) / (2 * kStep);
  }
  for (std::size_t k = 0; k < head.exponents.size(); ++k) {
    const double slope = power(t, head.exponents[k]);
    J(0, kPlace + static_cast<Eigen::Index>(k)) = e.x() * slope;
    J(1, kPlace + static_cast<Eigen::Index>(k)) = head.aspect * e.y() * slope;
  }
  return J;
}

/// Which unknowns are held.
std::vector<bool> fixed_columns(const PolynomialHead& head, const FitFreedom& freedom) {
  std::vector<bool> fixed{!freedom.center, !freedom.center, !freedom.aspect,
                          !freedom.turn,   !freedom.turn,   !freedom.turn};
  fixed.resize(kPlace + head.exponents.size(), false);
  return fixed;
}

PolynomialHead moved(const PolynomialHead& from, const Eigen::VectorXd& step) {
  PolynomialHead head = from;
  head.cx += step[0];
  head.cy += step[1];
  head.aspect += step[2];
  head.R_fitted_given = geometry::rotation_about(step.segment<3>(3)) * head.R_fitted_given;
  for (std::size_t k = 0; k < head.exponents.size(); ++k) {
    head.coefficients[k] += step[kPlace + static_cast<Eigen::Index>(k)];
  }
  return head;
}

/// The best head after at most `steps` steps from `start`.
PolynomialHead improved(const std::vector<geometry::RayPixel>& samples, const PolynomialHead& start,
                        const FitFreedom& freedom, int steps) {
  const auto evaluate = [&](const PolynomialHead& head) {
    solve::Evaluation sum{solve::NormalEquations(kPlace + static_cast<int>(head.exponents.size()))};
    for (const geometry::RayPixel& sample : samples) {
      const Eigen::Matrix<double, 2, Eigen::Dynamic, Eigen::RowMajor> J = derivatives(head, sample.ray, freedom.turn);
      const geometry::Pixel p = head.project(sample.ray);
      sum.equations.add(J.row(0).data(), p.x - sample.pixel.x, 1);
      sum.equations.add(J.row(1).data(), p.y - sample.pixel.y, 1);
    }
    sum.cost = sum.equations.cost();
    return sum;
  };
  return solve::descend(start, evaluate, moved, fixed_columns(start, freedom),
                        {.most_steps = steps,
                         .most_refusals = kMaxRefusals,
                         .enough = kEnough,
                         .first_damping = kDamping,
                         .least_damping = kDamping})
      .state;
}

}  // namespace

double radial_basis(RadialBasis basis, double angle) {
  switch (basis) {
    case RadialBasis::kAngle: return angle;
    case RadialBasis::kTangent: return std::tan(angle);
    case RadialBasis::kHalfTangent: return std::tan(angle / 2);
  }
  return angle;
}

geometry::Pixel PolynomialHead::project(const Eigen::Vector3d& given) const {
  const Eigen::Vector3d ray = R_fitted_given * given;
  const double s = std::hypot(ray.x(), ray.y());
  if (s == 0) return {cx, cy};
  const double r = radius_at(*this, angle_of(ray));
  return {cx + r * ray.x() / s, cy + aspect * r * ray.y() / s};
}

Result<PolynomialHead> fit_polynomial_head(const std::vector<geometry::RayPixel>& samples, const PolynomialHead& start,
                                           const FitFreedom& freedom) {
  std::vector<geometry::RayPixel> held;
  for (const geometry::RayPixel& sample : samples) {
    if (reaches(start.basis, angle_of(sample.ray))) held.push_back(sample);
  }
  if (held.size() < 10) return fail(Errc::kBadValue, "its lens sees next to nothing that this form can hold");
  PolynomialHead head = start;
  head.coefficients.assign(head.exponents.size(), 0.0);
  // The problem is linear in the coefficients: they are fitted first and alone, then all unknowns.
  head = improved(held, head, {false, false, false}, 1);
  head = improved(held, head, freedom, kSteps);
  double square = 0;
  for (const geometry::RayPixel& sample : held) {
    const geometry::Pixel p = head.project(sample.ray);
    const double off = std::hypot(p.x - sample.pixel.x, p.y - sample.pixel.y);
    square += off * off;
    head.max_px = std::max(head.max_px, off);
  }
  head.rms_px = std::sqrt(square / static_cast<double>(held.size()));
  if (!std::isfinite(head.rms_px)) return fail(Errc::kBadValue, "its lens cannot be fitted in this form");
  return head;
}

LensModel lens_of(const PolynomialHead& fit) {
  const bool odd = std::ranges::all_of(fit.exponents, [](int e) { return e % 2 == 1 && e <= 9; });
  std::vector<double> dense(static_cast<std::size_t>(std::ranges::max(fit.exponents)), 0.0);
  for (std::size_t k = 0; k < fit.exponents.size(); ++k) {
    dense[static_cast<std::size_t>(fit.exponents[k] - 1)] = fit.coefficients[k];
  }
  if (fit.basis == RadialBasis::kTangent) return RectilinearLens{dense};
  if (!odd || !(dense[0] > 0)) return EquidistantLens{dense};
  dense.resize(9, 0.0);
  const double f = dense[0];
  return KannalaBrandtLens{f, {dense[2] / f, dense[4] / f, dense[6] / f, dense[8] / f}};
}

}  // namespace nodal::interchange
