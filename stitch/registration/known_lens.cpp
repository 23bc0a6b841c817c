#include "stitch/registration/known_lens.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <string>

#include "protocol/base/angles.h"
#include "protocol/base/try.h"
#include "stitch/geometry/lens/lens.h"
#include "stitch/registration/check_frames.h"

namespace nodal::registration {
namespace {

constexpr double kKnownPart = 0.02;     // a radius is known if no kind of lens differs by more than this share of it
constexpr double kFamilyUnsure = 0.05;  // how far real lenses are from their kind, as a share of the radius
constexpr int kAngles = 400;

/// The radius of a kind of lens by the angle, in focal lengths, and the angle up to which such lenses are built.
struct Kind {
  double (*radius)(double);
  double most_deg;
};
constexpr double kEverywhere = 180;
const std::array<Kind, 5> kKinds{{{[](double a) { return a; }, kEverywhere},
                                  {[](double a) { return 2 * std::sin(a / 2); }, kEverywhere},
                                  {[](double a) { return 2 * std::tan(a / 2); }, 150},
                                  {[](double a) { return std::sin(a); }, 90},
                                  {[](double a) { return std::tan(a); }, 75}}};

/// How much the lens and any kind that reaches to its edge differ at an angle if they are the same at another one.
double doubt(const geometry::Lens& lens, double angle, double same, double edge) {
  const double is = lens.radius(angle).value_or(0) / lens.radius(same).value_or(1);
  double most = 0;
  for (const Kind& kind : kKinds) {
    if (edge > kind.most_deg * kRadiansPerDegree) continue;
    const double other = kind.radius(angle) / kind.radius(same);
    most = std::max({most, std::abs(other / is - 1), std::abs(is / other - 1)});
  }
  return most;
}

}  // namespace

Result<KnownLens> known_lens(const Calibration& result, const SeenRadii& seen, const Options& asked, Free estimated) {
  const HeadCalibration& head = result.heads.front();
  NODAL_TRY_ASSIGN(const geometry::Lens lens, geometry::Lens::make(head.lens, head.max_angle));
  KnownLens known{seen.from_deg, seen.to_deg, 0, 0, asked.lens_far_off ? kFamilyUnsure : 0};
  if (asked.lens_kind_assumed) {
    const double edge = std::min(lens.max_angle(), seen.to_deg * kRadiansPerDegree);
    const double same = estimated == Free::kRotations ? edge : (seen.from_deg + seen.to_deg) / 2 * kRadiansPerDegree;
    known.from_deg = known.to_deg = same * kDegreesPerRadian;
    for (int k = 0; k < kAngles; ++k) {
      const double angle = edge * (k + 0.5) / kAngles, off = doubt(lens, angle, same, edge);
      known.unsure = std::max(known.unsure, off);
      if (off > kKnownPart) continue;
      known.from_deg = std::min(known.from_deg, angle * kDegreesPerRadian);
      known.to_deg = std::max(known.to_deg, angle * kDegreesPerRadian);
    }
    known.unsure += kKnownPart;  // what it may be wrong where kinds are the same
  }
  known.from_px = lens.radius(known.from_deg * kRadiansPerDegree).value_or(0);
  known.to_px = lens.radius(known.to_deg * kRadiansPerDegree).value_or(lens.max_radius());
  return known;
}

std::string commented(const std::string& comment, const KnownLens& known) {
  static const std::string kBegin = "The lenses are known ";
  std::string before = comment.substr(0, comment.find(kBegin));
  while (before.ends_with(' ')) before.pop_back();
  return before + (before.empty() ? "" : " ") + kBegin + where_known(known) + ".";
}

}  // namespace nodal::registration
