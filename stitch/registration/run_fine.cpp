#include <algorithm>

#include "stitch/registration/run.h"

namespace nodal::registration {
namespace {

constexpr double kStrictHuber = 0.3;  // of the rms difference: what lines up outweighs what stands near

}  // namespace

// Of the detail that a seam shows on both sides, at the worst of them.
Result<double> Run::least_agreement() const {
  const Result<Detail> detail = measure_detail(detail_plan(), pyramids_, heads_, used(), options_, workers_);
  if (!detail) return fail(detail.error());
  double least = 1;
  for (const PairSums& pair : detail->pairs) {
    if (pair.solid_angle > kSmallOverlapSr * channels()) least = std::min(least, pair.correlation());
  }
  return least;
}

// From a data sheet's lenses there are many valleys, and what stands near the rig decides which one is taken. Plans
// `first` to before `last` are descended twice, the second time with it counting less; the better of the two is that
// whose worst seam lines up better.
Status Run::choose_valley(std::size_t first, std::size_t last) {
  struct Valley {
    std::vector<HeadState> heads;
    std::vector<Step> steps;
    std::optional<Normal> normal;
    double huber_share = kHuberShare, agreement = -2;
  } best;
  const std::vector<HeadState> start = heads_;
  const std::vector<Step> steps = report_.steps;
  Status done;
  for (const double huber_share : {kHuberShare, kStrictHuber}) {
    heads_ = start;
    report_.steps = steps;
    huber_share_ = huber_share;
    done = {};
    for (std::size_t p = first; done && p < last; ++p) done = descend_level(plans_[p]);
    if (!done) continue;
    const Result<double> agreement = least_agreement();
    if (agreement && *agreement > best.agreement) best = {heads_, report_.steps, last_, huber_share, *agreement};
  }
  if (best.heads.empty()) return done;
  heads_ = std::move(best.heads);
  report_.steps = std::move(best.steps);
  last_ = std::move(best.normal);
  huber_share_ = best.huber_share;
  return {};
}

Status Run::descend_fine() {
  auto p = static_cast<std::size_t>(std::ranges::find_if_not(plans_, is_coarse) - plans_.begin());
  if (lenses_far_off() && p < plans_.size()) {
    const std::size_t decided = std::max(p + 1, plans_.size() - 1);
    if (Status chosen = choose_valley(p, decided); !chosen) return chosen;
    p = decided;
  }
  for (; p < plans_.size(); ++p) {
    if (Status done = descend_level(plans_[p]); !done) return done;
  }
  return {};
}

}  // namespace nodal::registration
