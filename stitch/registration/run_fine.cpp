#include <algorithm>

#include "protocol/base/try.h"
#include "stitch/registration/run.h"

namespace nodal::registration {
namespace {

// Share of the rms difference; lowers the weight of close objects, which do not line up.
constexpr double kStrictHuber = 0.3;

// The agreement of the heads' detail at the worst seam.
double least_agreement(const Detail& detail, int channels) {
  double least = 1;
  for (const PairSums& pair : detail.pairs) {
    if (pair.solid_angle > kSmallOverlapSr * channels) least = std::min(least, pair.correlation());
  }
  return least;
}

}  // namespace

// With a data sheet's lenses the objective has many local minima, and objects close to the rig influence which one is
// reached. Runs levels [first, last) twice, the second time with a lower weight for such objects, and keeps the result
// whose worst seam agrees better.
Status Run::choose_valley(std::size_t first, std::size_t last) {
  struct Valley {
    std::vector<HeadState> heads;
    std::vector<Step> steps;
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
    const Result<Detail> detail =
        measure_detail(detail_plan(plans_), *frames_.pyramids, heads_, placed_heads(why_not_), options_, workers_);
    if (!detail) continue;
    const double agreement = least_agreement(*detail, channels_of(options_));
    if (agreement > best.agreement) best = {heads_, report_.steps, huber_share, agreement};
  }
  if (best.heads.empty()) return done;
  heads_ = std::move(best.heads);
  report_.steps = std::move(best.steps);
  huber_share_ = best.huber_share;
  return {};
}

Status Run::descend_fine() {
  auto p = static_cast<std::size_t>(std::ranges::find_if_not(plans_, is_coarse) - plans_.begin());
  if (lenses_far_off(options_) && p < plans_.size()) {
    const std::size_t decided = std::max(p + 1, plans_.size() - 1);
    NODAL_TRY(choose_valley(p, decided));
    p = decided;
  }
  for (; p < plans_.size(); ++p) {
    NODAL_TRY(descend_level(plans_[p]));
  }
  return {};
}

}  // namespace nodal::registration
