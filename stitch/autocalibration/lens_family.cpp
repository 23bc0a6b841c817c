#include "stitch/autocalibration/lens_family.h"

#include <Eigen/QR>
#include <cmath>

#include "protocol/base/angles.h"

namespace nodal::autocalibration {
namespace {

/// The radius at an angle, with focal length 1.
double radius_of(Family family, double angle) {
  switch (family) {
    case Family::kEquidistant: return angle;
    case Family::kEquisolid: return 2 * std::sin(angle / 2);
    case Family::kStereographic: return 2 * std::tan(angle / 2);
    case Family::kOrthographic: return std::sin(angle);
    case Family::kRectilinear: return std::tan(angle);
  }
  return angle;
}

/// Up to which angle lenses of the family are built, rad.
double reach_of(Family family) {
  switch (family) {
    case Family::kOrthographic: return 80 * kRadiansPerDegree;
    case Family::kRectilinear: return 58 * kRadiansPerDegree;
    default: return 120 * kRadiansPerDegree;
  }
}

}  // namespace

std::string_view family_name(Family family) {
  switch (family) {
    case Family::kEquidistant: return "equidistant";
    case Family::kEquisolid: return "equisolid";
    case Family::kStereographic: return "stereographic";
    case Family::kOrthographic: return "orthographic";
    case Family::kRectilinear: return "rectilinear";
  }
  return "";
}

std::vector<Family> families_reaching(double edge) {
  std::vector<Family> all;
  for (const Family family : {Family::kRectilinear, Family::kEquidistant, Family::kEquisolid, Family::kStereographic,
                              Family::kOrthographic}) {
    const bool narrow = family == Family::kRectilinear || family == Family::kOrthographic;
    if (!narrow || edge < reach_of(family)) all.push_back(family);
  }
  return all;
}

std::optional<Family> family_named(std::string_view name) {
  for (const Family family : {Family::kEquidistant, Family::kEquisolid, Family::kStereographic, Family::kOrthographic,
                              Family::kRectilinear}) {
    if (family_name(family) == name) return family;
  }
  return std::nullopt;
}

KannalaBrandtLens family_lens(Family family) { return family_lens(family, reach_of(family)); }

KannalaBrandtLens family_lens(Family family, double reach) {
  constexpr int kSamples = 60;
  // r / a - 1 = k1 a^2 + k2 a^4 + k3 a^6 + k4 a^8, by least squares.
  Eigen::Matrix<double, kSamples, 4> A;
  Eigen::Matrix<double, kSamples, 1> b;
  for (int i = 0; i < kSamples; ++i) {
    const double a = reach * (i + 1) / kSamples;
    for (int k = 0; k < 4; ++k) A(i, k) = std::pow(a, 2 * (k + 1));
    b[i] = radius_of(family, a) / a - 1;
  }
  const Eigen::Vector4d k = A.colPivHouseholderQr().solve(b);
  return {1, {k[0], k[1], k[2], k[3]}};
}

std::array<double, 2> family_sigma(double edge, double part) {
  return {part / std::pow(edge, 2), part / std::pow(edge, 4)};
}

}  // namespace nodal::autocalibration
