#include "stitch/registration/radial_table.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "protocol/base/try.h"
#include "stitch/geometry/lens/lens.h"

namespace nodal::registration {
namespace {

template <class... F>
struct Overloaded : F... {
  using F::operator()...;
};
template <class... F>
Overloaded(F...) -> Overloaded<F...>;

// Four coefficients of a polynomial lens are estimated, even if the prior has fewer.
constexpr std::size_t kPolynomialOrder = 4;

std::vector<double> changed_polynomial(std::vector<double> c, double scale, const std::vector<double>& radial,
                                       double edge) {
  if (!radial.empty()) c.resize(std::max(c.size(), kPolynomialOrder), 0.0);
  for (double& each : c) each *= scale;
  for (std::size_t k = 0; k < radial.size(); ++k) c[k + 1] += radial[k] / std::pow(edge, k + 2);
  return c;
}

// Derivatives of the radius r at angle a by log focal and by each coefficient.
struct RadialDerivatives {
  double a, r, edge_angle, edge_radius;
  std::vector<double> operator()(const TsaiLens& lens) const {
    const double s = r * r;
    const double slope = 1 + s * (3 * lens.kappa1 + 5 * lens.kappa2 * s);
    const double x = r / edge_radius;
    return {r * (1 + s * (lens.kappa1 + lens.kappa2 * s)) / slope, -x * x * x / slope, -x * x * x * x * x / slope};
  }
  std::vector<double> operator()(const RectilinearLens&) const { return powers(std::tan(a), std::tan(edge_angle)); }
  std::vector<double> operator()(const EquidistantLens&) const { return powers(a, edge_angle); }
  std::vector<double> operator()(const KannalaBrandtLens&) const {
    const double x = a / edge_angle;
    return {r, x * x * x, x * x * x * x * x};
  }
  std::vector<double> powers(double t, double edge) const {
    std::vector<double> all{r};
    for (std::size_t k = 2; k <= kPolynomialOrder; ++k) all.push_back(std::pow(t / edge, k));
    return all;
  }
};

}  // namespace

int radial_count(const LensModel& lens) {
  return std::visit(Overloaded{[](const TsaiLens&) { return 2; },
                               [](const RectilinearLens&) { return static_cast<int>(kPolynomialOrder) - 1; },
                               [](const EquidistantLens&) { return static_cast<int>(kPolynomialOrder) - 1; },
                               [](const KannalaBrandtLens&) { return 2; }},
                    lens);
}

LensModel changed_lens(const LensModel& lens, double log_focal, const std::vector<double>& radial, double edge_angle,
                       double edge_radius) {
  const double scale = std::exp(log_focal);
  LensModel changed = lens;
  std::visit(Overloaded{[&](TsaiLens& tsai) {
                          tsai.focal *= scale;
                          if (radial.empty()) return;
                          tsai.kappa1 += radial[0] / std::pow(edge_radius, 3);
                          tsai.kappa2 += radial[1] / std::pow(edge_radius, 5);
                        },
                        [&](RectilinearLens& rectilinear) {
                          rectilinear.coefficients = changed_polynomial(std::move(rectilinear.coefficients), scale,
                                                                        radial, std::tan(edge_angle));
                        },
                        [&](EquidistantLens& equidistant) {
                          equidistant.coefficients =
                              changed_polynomial(std::move(equidistant.coefficients), scale, radial, edge_angle);
                        },
                        [&](KannalaBrandtLens& kb) {
                          kb.focal *= scale;
                          if (radial.empty()) return;
                          kb.k[0] += radial[0] / (kb.focal * std::pow(edge_angle, 3));
                          kb.k[1] += radial[1] / (kb.focal * std::pow(edge_angle, 5));
                        }},
             changed);
  return changed;
}

Result<RadialTable> RadialTable::make(const LensModel& model, double max_angle, double edge_angle, double edge_radius,
                                      bool derivatives) {
  NODAL_TRY_ASSIGN(const geometry::Lens lens, geometry::Lens::make(model, max_angle));
  RadialTable table;
  const double last_angle = std::min(max_angle, lens.max_angle());
  const double cell = std::sin(last_angle / 2) / kCells;
  table.max_t_ = static_cast<float>(std::sin(last_angle / 2));
  table.cells_per_t_ = static_cast<float>(1 / cell);
  if (derivatives) table.derivatives_.resize(static_cast<std::size_t>(1 + radial_count(model)));
  for (int i = 0; i <= kCells + 1; ++i) {
    // On the axis the functions are limits, and straight behind they may be infinite: both ends are approached only.
    const double a =
        std::clamp(2 * std::asin(std::min(i * cell, 1.0)), 1e-4, std::min(last_angle, std::numbers::pi - 1e-3));
    const double r = lens.radius(a).value_or(lens.max_radius());
    const double slope = lens.slope(a, r);
    const double s = std::sin(a), q = r / s;
    const double dq_da = (slope - q * std::cos(a)) / s;
    table.nodes_.push_back({static_cast<float>(q), static_cast<float>(dq_da * 2 / std::cos(a / 2) * cell)});
    table.density_.push_back(static_cast<float>(q * slope));
    if (!derivatives) continue;
    const std::vector<double> dr = std::visit(RadialDerivatives{a, r, edge_angle, edge_radius}, model);
    for (std::size_t k = 0; k < dr.size(); ++k) table.derivatives_[k].push_back(static_cast<float>(dr[k] / s));
  }
  return table;
}

}  // namespace nodal::registration
