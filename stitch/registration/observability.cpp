#include "stitch/registration/observability.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "protocol/base/try.h"
#include "stitch/geometry/lens/lens.h"

namespace nodal::registration {
namespace {

double worst_sigma(const Eigen::Matrix3d& information) {
  const double least = Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(information).eigenvalues().minCoeff();
  return least > 0 ? 1 / std::sqrt(least) : std::numeric_limits<double>::infinity();
}

// Share of the median head's detail; wide differences between scenes' parts are above 0.5.
constexpr double kLittleDetail = 1.0 / 3;

}  // namespace

std::vector<bool> with_little_detail(const Detail& detail, const std::vector<bool>& used) {
  std::vector<double> rms;
  for (std::size_t h = 0; h < used.size(); ++h) {
    if (used[h]) rms.push_back(detail.heads[h].rms);
  }
  std::vector<bool> little(used.size(), false);
  if (rms.empty()) return little;
  const auto middle = rms.begin() + static_cast<std::ptrdiff_t>(rms.size() / 2);
  std::ranges::nth_element(rms, middle);
  for (std::size_t h = 0; h < used.size(); ++h) little[h] = used[h] && detail.heads[h].rms < kLittleDetail * *middle;
  return little;
}

std::vector<double> fall_off_seen(const std::vector<HeadState>& heads) {
  constexpr int kRays = 4000;
  std::vector<geometry::Lens> lenses;
  std::vector<double> reach, spreads(heads.size());
  for (const HeadState& head : heads) {
    const Result<geometry::Lens> lens = geometry::Lens::make(head.lens, head.max_angle);
    const Result<double> angle = head.used_angle();
    if (!lens || !angle) return spreads;
    lenses.push_back(*lens);
    reach.push_back(*angle);
  }
  std::vector<std::vector<double>> distances(heads.size());
  for (int k = 0; k < kRays; ++k) {
    // Directions spread evenly over the sphere: equal steps in height, golden angle in longitude.
    const double y = 1 - (2 * k + 1.0) / kRays, round = k * std::numbers::pi * (3 - std::sqrt(5.0)),
                 r = std::sqrt(1 - y * y);
    const Eigen::Vector3d ray(r * std::cos(round), y, r * std::sin(round));
    std::vector<std::pair<std::size_t, double>> seen;
    for (std::size_t h = 0; h < heads.size(); ++h) {
      const Eigen::Vector3d own = heads[h].q_head_rig * ray;
      const double angle = std::atan2(std::hypot(own.x(), own.y()), own.z());
      if (angle > reach[h]) continue;
      if (const auto radius = lenses[h].radius(angle))
        seen.emplace_back(h, std::pow(*radius / heads[h].edge_radius, 2));
    }
    if (seen.size() < 2) continue;
    for (const auto& [h, distance] : seen) distances[h].push_back(distance);
  }
  for (std::size_t h = 0; h < heads.size(); ++h) {
    std::vector<double>& all = distances[h];
    if (all.empty()) continue;
    std::ranges::sort(all);
    spreads[h] = all[all.size() * 95 / 100] - all[all.size() * 5 / 100];
  }
  return spreads;
}

Result<Detail> measure_detail(const LevelPlan& plan, const std::vector<HeadPyramid>& pyramids,
                              const std::vector<HeadState>& heads, const std::vector<bool>& used,
                              const Options& options, const parallel::Workers& workers) {
  Options sum = options;
  sum.norm = Norm::kSum;
  NODAL_TRY_ASSIGN(std::unique_ptr<Level> level,
                   Level::make(plan, Level::Pictures::kDetail, pyramids, heads, sum, 0.01, workers));
  level->objective().set_used(used);
  Sought rotations;
  rotations.gain = rotations.vignetting = false;
  NODAL_TRY_ASSIGN(const Normal normal, level->objective().evaluate(heads, rotations, true));
  Detail detail;
  detail.pairs = normal.pairs;
  const int n = normal.heads;
  for (int h = 0; h < n; ++h) {
    PairSums all;  // sums over the pairs of this head (a) with every other one (b)
    double total = 0;
    for (int other = 0; other < n; ++other) {
      if (other == h) continue;
      const PairSums& pair = normal.pairs[normal.pair(std::min(h, other), std::max(h, other))];
      all.measure += pair.measure;
      all.difference += pair.difference;
      all.aa += h < other ? pair.aa : pair.bb;
      all.bb += h < other ? pair.bb : pair.aa;
      all.ab += pair.ab;
      total += pair.measure;
    }
    HeadDetail mine;
    mine.rms = total > 0 ? std::sqrt(all.aa / total) : 0;
    mine.agreement = all.correlation();
    // The noise is the difference of the two, half of it for each.
    const double noise = total > 0 ? all.difference / total / 2 : 0;
    const Eigen::Matrix3d H = normal.hessian(h, h, Curvature::kCommon);
    mine.sigma_rad = total > 0 ? worst_sigma(H / std::max(noise * level->pixels_a_sample(), 1e-12))
                               : std::numeric_limits<double>::infinity();
    mine.shared_sr =
        normal.shared[static_cast<std::size_t>(h)] / static_cast<double>(pyramids.front().levels.front().size());
    detail.heads.push_back(mine);
  }
  return detail;
}

}  // namespace nodal::registration
