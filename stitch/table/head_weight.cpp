#include "stitch/table/head_weight.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

namespace nodal::table {
namespace {

/// Keeps the weight of a head above 0 close to its edge, where it may be the only head.
constexpr double kMinFeather = 1e-6;
constexpr double kMinDepth = 1e-12;

}  // namespace

double weight_of(const HeadSight& seen, bool seams, double depth_per_px) {
  // Seams need continuous slopes: kMinDepth is added, because max(depth, kMinDepth) has a jump in its slope.
  if (seams) return seen.density * (seen.depth + kMinDepth);
  return seen.density * std::max(kMinFeather, smoothstep(seen.inside * depth_per_px));
}

double score_of(const HeadSight& seen, double depth_per_px) { return std::sqrt(weight_of(seen, true, depth_per_px)); }

double steepest_score(const geometry::Head& head, const HeadOptics& optics) {
  constexpr int kAngles = 64, kTurns = 64;
  constexpr double kStep = 1e-5;  // rad
  constexpr double kMargin = 1.5;
  constexpr double kNoLimit = std::numeric_limits<double>::infinity();
  if (!head.masks().empty()) return kNoLimit;
  const double reach = std::acos(std::clamp(optics.cos_reach, -1.0, 1.0));
  double most = 0;
  for (int k = 0; k < kAngles; ++k) {
    const double angle = reach * std::sin(std::numbers::pi / 2 * (k + 0.5) / kAngles);  // denser towards the rim
    for (int t = 0; t < kTurns; ++t) {
      const double turn = 2 * std::numbers::pi * t / kTurns;
      const auto at = [&](double a, double side) {
        const Eigen::Vector3d d(std::sin(a) * std::cos(turn) - side * std::sin(turn),
                                std::sin(a) * std::sin(turn) + side * std::cos(turn), std::cos(a));
        return see(head, optics.lens, d, optics.depth_per_px);
      };
      const auto here = at(angle, 0), along = at(angle + kStep, 0), beside = at(angle, kStep);
      if (!here || !along || !beside || here->inside < kEdge || !(here->density < kEndless)) continue;
      const double score = score_of(*here, optics.depth_per_px);
      most = std::max(most, std::hypot(score_of(*along, optics.depth_per_px) - score,
                                       score_of(*beside, optics.depth_per_px) - score));
    }
  }
  return kMargin * most / kStep;
}

}  // namespace nodal::table
