#include "stitch/geometry/lens/lens.h"

#include <array>
#include <cmath>
#include <string>

#include "protocol/base/angles.h"
#include "protocol/base/try.h"
#include "protocol/lens_range.h"

namespace nodal::geometry {
namespace {

std::array<double, 5> tsai_coefficients(const TsaiLens& lens) { return {1, 0, lens.kappa1, 0, lens.kappa2}; }

std::array<double, 9> kannala_brandt_coefficients(const KannalaBrandtLens& lens) {
  const double f = lens.focal;
  return {f, 0, f * lens.k[0], 0, f * lens.k[1], 0, f * lens.k[2], 0, f * lens.k[3]};
}

bool within(double value, double end) { return value >= 0 && value <= end; }

/// A value past `end` by rounding only becomes `end`; farther out the result is nothing.
std::optional<double> up_to(double value, double end) {
  constexpr double kRounding = 1e-12;
  if (!within(value, end * (1 + kRounding))) return std::nullopt;
  return std::min(value, end);
}

}  // namespace

Tsai::Tsai(const TsaiLens& lens)
    : focal_(lens.focal),
      ideal_of_original_(tsai_coefficients(lens), lens_range(lens).max_radius),
      max_angle_(lens_range(lens).max_angle) {}

std::optional<double> Tsai::radius(double angle) const {
  if (!within(angle, max_angle_)) return std::nullopt;
  // At the very end, rounding must not raise tan above the last value.
  return ideal_of_original_.inverse(std::min(focal_ * std::tan(angle), ideal_of_original_.max_value()));
}

std::optional<double> Tsai::angle(double radius) const {
  if (!within(radius, ideal_of_original_.max_x())) return std::nullopt;
  return std::min(std::atan(ideal_of_original_.value(radius) / focal_), max_angle_);
}

double Tsai::slope(double, double radius) const {
  const double t = ideal_of_original_.value(radius) / focal_;
  return focal_ * (1 + t * t) / ideal_of_original_.slope(radius);
}

Rectilinear::Rectilinear(const RectilinearLens& lens)
    : radius_of_tangent_(lens.coefficients, std::tan(kMaxPinholeAngle)) {}

double Rectilinear::max_angle() const { return std::atan(radius_of_tangent_.max_x()); }

std::optional<double> Rectilinear::radius(double angle) const {
  if (!within(angle, max_angle())) return std::nullopt;
  return radius_of_tangent_.value(std::min(std::tan(angle), radius_of_tangent_.max_x()));
}

std::optional<double> Rectilinear::angle(double radius) const {
  const std::optional<double> t = radius_of_tangent_.inverse(radius);
  if (!t) return std::nullopt;
  return std::atan(*t);
}

double Rectilinear::slope(double angle, double) const {
  const double t = std::tan(angle);
  return radius_of_tangent_.slope(t) * (1 + t * t);
}

Equidistant::Equidistant(const EquidistantLens& lens) : radius_of_angle_(lens.coefficients, kPi) {}

std::optional<double> Equidistant::radius(double angle) const {
  if (!within(angle, max_angle())) return std::nullopt;
  return radius_of_angle_.value(angle);
}

double Equidistant::slope(double angle, double) const { return radius_of_angle_.slope(angle); }

KannalaBrandt::KannalaBrandt(const KannalaBrandtLens& lens)
    : radius_of_angle_(kannala_brandt_coefficients(lens), kPi) {}

std::optional<double> KannalaBrandt::radius(double angle) const {
  if (!within(angle, max_angle())) return std::nullopt;
  return radius_of_angle_.value(angle);
}

double KannalaBrandt::slope(double angle, double) const { return radius_of_angle_.slope(angle); }

Result<Lens> Lens::make(const LensModel& model, double max_angle) {
  NODAL_TRY(check_lens(model, max_angle));
  Lens lens(std::visit(
      [](const auto& m) -> Model {
        using M = std::decay_t<decltype(m)>;
        if constexpr (std::is_same_v<M, TsaiLens>) return Tsai(m);
        else if constexpr (std::is_same_v<M, RectilinearLens>) return Rectilinear(m);
        else if constexpr (std::is_same_v<M, EquidistantLens>) return Equidistant(m);
        else return KannalaBrandt(m);
      },
      model));
  const double model_end = std::visit([](const auto& m) { return m.max_angle(); }, lens.model_);
  lens.max_angle_ = max_angle > 0 ? std::min(max_angle, model_end) : model_end;
  lens.max_radius_ = std::visit([&](const auto& m) { return m.radius(lens.max_angle_).value_or(0); }, lens.model_);
  return lens;
}

std::optional<double> Lens::radius(double angle) const {
  const std::optional<double> a = up_to(angle, max_angle_);
  if (!a) return std::nullopt;
  const std::optional<double> radius = std::visit([&](const auto& m) { return m.radius(*a); }, model_);
  if (!radius) return std::nullopt;
  return std::min(*radius, max_radius_);
}

std::optional<double> Lens::angle(double radius) const {
  const std::optional<double> r = up_to(radius, max_radius_);
  if (!r) return std::nullopt;
  const std::optional<double> angle = std::visit([&](const auto& m) { return m.angle(*r); }, model_);
  if (!angle) return std::nullopt;
  return std::min(*angle, max_angle_);
}

double Lens::slope(double angle) const {
  return slope(angle, std::visit([angle](const auto& m) { return m.radius(angle).value_or(0); }, model_));
}

double Lens::slope(double angle, double radius) const {
  return std::visit([=](const auto& m) { return m.slope(angle, radius); }, model_);
}

}  // namespace nodal::geometry
