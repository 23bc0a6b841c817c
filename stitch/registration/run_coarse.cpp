#include <algorithm>

#include "protocol/base/try.h"
#include "stitch/registration/run.h"

namespace nodal::registration {
namespace {

// A rival rotation is tried from this share of the result's support on. Below, it is a chance.
constexpr double kEqualRival = 0.6;
// With a lower objective than this share of the result's a rival is better; with less than this multiple it is as good.
constexpr double kBetter = 0.7, kAsGood = 2.5;
constexpr std::size_t kTried = 4;  // rivals of a result that are tried
// Of two rotations that are as good, one is no alternative if it is so many times farther from the prior.
constexpr double kMuchFarther = 3;

// How far a head is turned from the prior, as the median of the other heads sees it, rad.
double turned_from(const std::vector<HeadState>& prior, const std::vector<HeadState>& now, std::size_t head) {
  const auto relative = [head](const std::vector<HeadState>& heads, std::size_t other) {
    return heads[head].q_head_rig * heads[other].q_head_rig.inverse();
  };
  std::vector<double> turns;
  for (std::size_t other = 0; other < now.size(); ++other) {
    if (other != head) turns.push_back(relative(prior, other).angularDistance(relative(now, other)));
  }
  if (turns.empty()) return 0;
  const auto middle = turns.begin() + static_cast<std::ptrdiff_t>(turns.size() / 2);
  std::ranges::nth_element(turns, middle);
  return *middle;
}

}  // namespace

// Runs the coarse levels from the prior, and, if the heads then disagree, again from the result of a search. Heads can
// agree with most of their neighbours and still form two separate groups; the count of disagreeing pairs shows this.
Status Run::descend_coarse() {
  const auto descend_all = [&]() -> Status {
    for (const LevelPlan& plan : plans_) {
      if (!is_coarse(plan)) continue;
      NODAL_TRY(descend_level(plan));
    }
    return {};
  };
  Status done = descend_all();
  if (!options_.search) return done;
  const bool agreed = done && check_agreement();
  if (agreed && agreement_.apart == 0) return {};
  const std::vector<HeadState> unsearched = heads_;
  const std::ptrdiff_t apart = agreement_.apart;
  work_.restart();
  NODAL_TRY_ASSIGN(std::vector<HeadState> found,
                   search_rotations(*frames_.pyramids, start_, placed_heads(why_not_), workers_));
  heads_ = std::move(found);
  Status again = descend_all();
  if (!agreed || (again && check_agreement() && agreement_.apart < apart)) return again;
  heads_ = unsearched;
  return {};
}

// Where things repeat, the coarsest pictures, which show light and no detail, may lead one tile or window away, and
// heads agree there. Of rotations that agree as well the one nearest to the prior is taken.
Status Run::check_rivals() {
  const auto finest_coarse = std::ranges::find_if(plans_.rbegin(), plans_.rend(), is_coarse);
  if (finest_coarse == plans_.rend()) return {};
  for (std::size_t round = 0; round < heads_.size(); ++round) {
    NODAL_TRY_ASSIGN(std::vector<Rival> rivals,
                     rival_rotations(*frames_.pyramids, heads_, placed_heads(why_not_), workers_));
    std::erase_if(rivals, [](const Rival& rival) { return rival.support < kEqualRival; });
    if (rivals.empty() || report_.steps.empty()) return {};
    rivals.resize(std::min(rivals.size(), kTried));
    const std::vector<HeadState> held = heads_;
    const Agreement agreement = agreement_;
    const double objective = report_.steps.back().objective;
    const auto from_prior = [&](const Rival& rival) {
      std::vector<HeadState> other = held;
      other[rival.head].q_head_rig = rival.q_head_rig;
      return turned_from(start_, other, rival.head);
    };
    std::ranges::stable_sort(rivals, {}, from_prior);
    bool replaced = false;
    rival_.reset();
    for (const Rival& rival : rivals) {
      heads_ = held;
      heads_[rival.head].q_head_rig = rival.q_head_rig;
      const double turned = turned_from(start_, held, rival.head), other = from_prior(rival);
      const bool agreed = descend_level(*finest_coarse) && check_agreement() && agreement_.apart <= agreement.apart;
      const double relative = report_.steps.back().objective / objective;
      replaced = agreed && (relative < kBetter || (relative < kAsGood && kMuchFarther * other < turned));
      if (replaced) break;
      if (agreed && relative < kAsGood && kMuchFarther * turned > other && !rival_) rival_ = rival;
    }
    if (replaced) continue;
    heads_ = held;
    agreement_ = agreement;
    return {};
  }
  return {};
}

}  // namespace nodal::registration
