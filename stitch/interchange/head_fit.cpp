#include "stitch/interchange/head_fit.h"

#include <Eigen/Geometry>
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

/// t by the angle, for a value of t.
double basis_slope(RadialBasis basis, double t) {
  switch (basis) {
    case RadialBasis::kAngle: return 1;
    case RadialBasis::kTangent: return 1 + t * t;
    case RadialBasis::kHalfTangent: return (1 + t * t) / 2;
  }
  return 1;
}

double power(double t, int n) {
  double value = 1;
  for (; n > 0; --n) value *= t;
  return value;
}

/// One ray's pixel, and its derivatives by all unknowns, px; by the rotation only if it is free.
class FittedPixel {
 public:
  FittedPixel(const PolynomialHead& head, bool turns)
      : head_(head),
        turns_(turns),
        u_(Eigen::RowVectorXd::Zero(kPlace + count())),
        v_(Eigen::RowVectorXd::Zero(kPlace + count())) {
    u_[0] = 1;
    v_[1] = 1;
  }

  void evaluate(const Eigen::Vector3d& given) {
    const Eigen::Vector3d ray = head_.R_fitted_given * given;
    const double s = std::hypot(ray.x(), ray.y());
    const Eigen::Vector2d e = s > 0 ? Eigen::Vector2d(ray.x() / s, ray.y() / s) : Eigen::Vector2d::Zero();
    const double t = radial_basis(head_.basis, std::atan2(s, ray.z()));
    double r = 0, slope = 0;  // slope: of r by t
    for (std::size_t k = 0; k < head_.exponents.size(); ++k) {
      const double before = power(t, head_.exponents[k] - 1);
      r += head_.coefficients[k] * before * t;
      slope += head_.coefficients[k] * head_.exponents[k] * before;
      u_[kPlace + static_cast<Eigen::Index>(k)] = e.x() * before * t;
      v_[kPlace + static_cast<Eigen::Index>(k)] = head_.aspect * e.y() * before * t;
    }
    v_[2] = e.y() * r;
    pixel_ = {head_.cx + r * e.x(), head_.cy + head_.aspect * r * e.y()};
    if (!turns_) return;
    // A small rotation w moves the ray by w x ray, so the derivative by w is ray x gradient.
    const double by_angle = slope * basis_slope(head_.basis, t) / ray.squaredNorm();
    const double across = s > 0 ? r / s : by_angle * ray.z();
    const Eigen::Vector3d outward(by_angle * ray.z() * e.x(), by_angle * ray.z() * e.y(), -by_angle * s);
    const Eigen::Vector3d by_u(across * (1 - e.x() * e.x()), -across * e.x() * e.y(), 0);
    const Eigen::Vector3d by_v(-across * e.x() * e.y(), across * (1 - e.y() * e.y()), 0);
    u_.segment<3>(3) = ray.cross(by_u + e.x() * outward);
    v_.segment<3>(3) = head_.aspect * ray.cross(by_v + e.y() * outward);
  }

  const geometry::Pixel& pixel() const { return pixel_; }
  const Eigen::RowVectorXd& by_u() const { return u_; }
  const Eigen::RowVectorXd& by_v() const { return v_; }

 private:
  Eigen::Index count() const { return static_cast<Eigen::Index>(head_.exponents.size()); }

  const PolynomialHead& head_;
  bool turns_;
  geometry::Pixel pixel_;
  Eigen::RowVectorXd u_, v_;
};

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
    FittedPixel at(head, freedom.turn);
    for (const geometry::RayPixel& sample : samples) {
      at.evaluate(sample.ray);
      sum.equations.add(at.by_u().data(), at.pixel().x - sample.pixel.x, 1);
      sum.equations.add(at.by_v().data(), at.pixel().y - sample.pixel.y, 1);
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
  const double t = radial_basis(basis, std::atan2(s, ray.z()));
  double r = 0;
  for (std::size_t k = 0; k < exponents.size(); ++k) r += coefficients[k] * power(t, exponents[k]);
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
