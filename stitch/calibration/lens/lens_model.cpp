#include "stitch/calibration/lens/lens_model.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <cmath>
#include <numbers>
#include <string>

#include "stitch/geometry/rotation.h"

namespace nodal::calibration {
namespace {

constexpr double kMaxTilted = 0.05;  // cosine between ray and plane normal; below it detail is smeared

/// For Tsai, r_ideal as a function of r; for fisheyes, r as a function of the angle.
geometry::RisingPolynomial polynomial_of(const LensParameters& lens) {
  std::vector<double> c;
  if (lens.kind == LensKind::kTsai) {
    c = {1, 0, lens[kFirstCoefficient + 1], 0, lens[kFirstCoefficient + 2]};
    return {c, 1e5};
  }
  for (int k = 0; kFirstCoefficient + k < lens.count; ++k) {
    c.resize(static_cast<std::size_t>(lens.exponent(k)), 0.0);
    c.back() = lens[kFirstCoefficient + k];
  }
  return {c, std::numbers::pi};
}

}  // namespace

Result<LensKind> lens_kind_named(std::string_view name) {
  if (name == "tsai") return LensKind::kTsai;
  if (name == "equidistant") return LensKind::kEquidistant;
  if (name == "kannala_brandt") return LensKind::kKannalaBrandt;
  return fail(Errc::kBadValue,
              "there is no lens model '" + std::string(name) + "'; there are tsai, equidistant and kannala_brandt");
}

int parameter_count(LensKind kind) {
  switch (kind) {
    case LensKind::kTsai: return kFirstCoefficient + 3;
    case LensKind::kEquidistant: return kFirstCoefficient + 4;
    case LensKind::kKannalaBrandt: return kFirstCoefficient + 5;
  }
  return kFirstCoefficient;
}

LensModel LensParameters::model() const {
  const int c = kFirstCoefficient;
  if (kind == LensKind::kTsai) return TsaiLens{(*this)[c], (*this)[c + 1], (*this)[c + 2]};
  if (kind == LensKind::kKannalaBrandt) {
    const double f = (*this)[c];
    return KannalaBrandtLens{f, {(*this)[c + 1] / f, (*this)[c + 2] / f, (*this)[c + 3] / f, (*this)[c + 4] / f}};
  }
  return EquidistantLens{{values.begin() + c, values.begin() + count}};
}

SightFinder::SightFinder(const LensParameters& lens) : lens_(lens), polynomial_(polynomial_of(lens)) {}

double SightFinder::max_radius() const {
  return lens_.kind == LensKind::kTsai ? polynomial_.max_x() : polynomial_.max_value();
}

std::optional<SightFinder::Angle> SightFinder::angle(double r) const {
  Angle a{};
  if (lens_.kind == LensKind::kTsai) {
    if (r > polynomial_.max_x()) return std::nullopt;
    const double f = lens_[kFirstCoefficient];
    const double ideal = polynomial_.value(r);
    const double scale = 1 / (f * f + ideal * ideal);
    a.value = std::atan2(ideal, f);
    a.by_radius = f * scale * polynomial_.slope(r);
    a.by_coefficient[0] = -ideal * scale;
    a.by_coefficient[1] = f * scale * r * r * r;
    a.by_coefficient[2] = a.by_coefficient[1] * r * r;
    return a;
  }
  const std::optional<double> value = polynomial_.inverse(r);
  if (!value) return std::nullopt;
  const double slope = polynomial_.slope(*value);
  if (!(slope > 0)) return std::nullopt;
  a.value = *value;
  a.by_radius = 1 / slope;
  const double step = lens_.kind == LensKind::kKannalaBrandt ? *value * *value : *value;
  double power = *value;
  for (int k = 0; kFirstCoefficient + k < lens_.count; ++k) {
    a.by_coefficient[static_cast<std::size_t>(k)] = -power / slope;
    power *= step;
  }
  return a;
}

std::optional<Sight> SightFinder::at(geometry::Pixel pixel) const {
  const double aspect = lens_[kAspect];
  const Eigen::Vector2d p(pixel.x - lens_[kCenterX], (pixel.y - lens_[kCenterY]) / aspect);
  const double r = p.norm();
  const std::optional<Angle> a = angle(r);
  if (!a) return std::nullopt;
  const double sine = std::sin(a->value);
  const double cosine = std::cos(a->value);
  const Eigen::Vector2d e = r > 1e-9 ? Eigen::Vector2d(p / r) : Eigen::Vector2d(1, 0);
  const double across = r > 1e-9 ? sine / r : a->by_radius;

  Sight sight;
  sight.ray << across * p, cosine;
  const Eigen::Vector3d by_angle(cosine * e.x(), cosine * e.y(), -sine);
  Eigen::Matrix<double, 3, 2> by_place = by_angle * a->by_radius * e.transpose();
  by_place.topRows<2>() += across * (Eigen::Matrix2d::Identity() - e * e.transpose());
  sight.by_pixel.col(0) = by_place.col(0);
  sight.by_pixel.col(1) = by_place.col(1) / aspect;
  sight.by_parameter.setZero();
  sight.by_parameter.col(kCenterX) = -sight.by_pixel.col(0);
  sight.by_parameter.col(kCenterY) = -sight.by_pixel.col(1);
  sight.by_parameter.col(kAspect) = by_place.col(1) * (-p.y() / aspect);
  for (int k = 0; kFirstCoefficient + k < lens_.count; ++k) {
    sight.by_parameter.col(kFirstCoefficient + k) = by_angle * a->by_coefficient[static_cast<std::size_t>(k)];
  }
  return sight;
}

Pose Pose::moved(const Eigen::Vector3d& w, const Eigen::Vector3d& d) const {
  const Eigen::Matrix3d turn = geometry::rotation_about(w);
  Pose pose;
  pose.R = turn * R;
  pose.t = turn * t + d;
  return pose;
}

PlaneFinder::PlaneFinder(const Pose& pose) : normal_(pose.R.col(2)) {
  Eigen::Matrix3d H;
  H << pose.R.col(0), pose.R.col(1), pose.t;
  inverse_ = H.inverse();
}

std::optional<PlanePoint> PlaneFinder::at(const Eigen::Vector3d& ray) const {
  const Eigen::Vector3d w = inverse_ * ray;
  if (!(w.z() > 0) || std::abs(normal_.dot(ray)) < kMaxTilted) return std::nullopt;
  PlanePoint point;
  point.distance = 1 / w.z();
  point.at = w.head<2>() * point.distance;
  point.in_head = ray * point.distance;
  point.by_move = inverse_.topRows<2>() - point.at * inverse_.row(2);
  return point;
}

}  // namespace nodal::calibration
