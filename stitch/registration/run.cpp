#include "stitch/registration/run.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <numbers>

#include "protocol/base/angles.h"
#include "protocol/base/try.h"
#include "stitch/geometry/held_light.h"
#include "stitch/registration/certainty.h"
#include "stitch/registration/check_frames.h"
#include "stitch/registration/gauge.h"
#include "stitch/registration/prepare.h"

namespace nodal::registration {
namespace {

// Share of the loosest head's uncertainty in pixels. Heads above it are removed together with that head, because it
// alone does not explain their looseness.
constexpr double kMuchLooser = 0.25;
// Pixels of the picture, or of the raymap if that is coarser: more is visible at seams.
constexpr double kLooseSigmaPx = 0.5;
constexpr int kAgreementWidth = 400;  // narrower raymaps show the position of the sky, but no detail
constexpr double kMinPairAgreement = 0.2;
constexpr double kClearAgreement = 0.4;  // agreement of a head with all others, from which on a level counts for it
// Spread of the shared rays' squared radii, relative to the edge's, that determines a fall-off.
constexpr double kMinFallOffSeen = 0.4;

Held held_on(const LevelPlan& plan, const std::vector<std::string>& why_not, bool geometry,
             const std::vector<bool>& own_vignetting) {
  Held held;
  held.geometry.resize(why_not.size());
  held.light.resize(why_not.size());
  held.first = -1;
  for (std::size_t h = 0; h < why_not.size(); ++h) {
    held.light[h] = !why_not[h].empty();
    held.geometry[h] = held.light[h] || !geometry;
    if (held.first < 0 && !held.geometry[h]) held.first = static_cast<int>(h);
  }
  held.share_lens = plan.share_lens;
  held.own_vignetting = own_vignetting;
  return held;
}

// A head that is not placed: rotation and lens become the prior's again; the estimate of its light is kept.
HeadState unplaced(const HeadState& prior, const HeadState& now) {
  HeadState back = prior;
  back.log_gain = now.log_gain;
  back.vignetting = now.vignetting;
  return back;
}

}  // namespace

std::vector<bool> placed_heads(const std::vector<std::string>& why_not) {
  std::vector<bool> placed;
  for (const std::string& why : why_not) placed.push_back(why.empty());
  return placed;
}

Status Run::prepare(const LitFrames& frames) {
  NODAL_TRY_ASSIGN(Prepared ready, registration::prepare(prior_, frames, options_));
  start_ = heads_ = std::move(ready.heads);
  frames_ = frames;
  plans_ = std::move(ready.plans);
  why_not_.resize(heads_.size());
  loose_sigma_.resize(heads_.size());
  loose_.resize(heads_.size());
  work_ = RunWork(plans_, options_);
  const std::vector<double> seen = fall_off_seen(heads_);
  std::vector<bool> tells;
  tells.reserve(seen.size());
  for (const double spread : seen) tells.push_back(spread >= kMinFallOffSeen);
  own_vignetting_.assign(heads_.size(), false);
  if (options_.vignetting == VignettingModel::kOwn) own_vignetting_ = tells;
  if (options_.vignetting != VignettingModel::kFixed && std::ranges::none_of(tells, std::identity())) {
    // The fit would follow flare and dark edges at the rims, and be arbitrary further inwards.
    options_.vignetting = VignettingModel::kFixed;
    report_.warnings.push_back(
        "the heads overlap only at the rims of their pictures; how the light falls off towards the rim (vignetting) "
        "cannot be measured there, so it stays as the calibration has it");
  }
  return {};
}

void Run::leave_out(std::size_t head, std::string why) {
  why_not_.resize(prior_.heads.size());
  why_not_[head] = std::move(why);
}

Status Run::descend_level(const LevelPlan& plan) {
  // A coarse level may still turn heads by tens of degrees.
  const double slack = plan.level >= 3 ? 0.5 : 0.1;
  NODAL_TRY_ASSIGN(std::unique_ptr<Level> level,
                   Level::make(plan, Level::Pictures::kLight, *frames_.pyramids, heads_, options_, slack, workers_));
  Objective& objective = level->objective();
  objective.set_used(placed_heads(why_not_));
  const Sought sought = sought_of(plan, options_);
  NODAL_TRY_ASSIGN(const Normal start, objective.evaluate(heads_, sought, false));
  if (start.measure <= 0) {
    // A narrow overlap may lie within a coarse level's margin; only the finest level has to contain it.
    if (plan.level == plans_.back().level) return fail(Errc::kNoCoverage, nothing_shared(prior_));
    work_.end_level(plan);
    return {};
  }
  huber_ = static_cast<float>(huber_share_ * std::sqrt(start.objective()));
  objective.set_huber(huber_);
  DescentOptions descent;
  descent.curvature = plan.curvature;
  descent.most_iterations = plan.most_iterations;
  descent.turn_rad = plan.turn_rad;
  if (!lenses_far_off(options_) && soft_priors_) descent.lens_noise = start.objective() * level->pixels_a_sample();
  descent.accepted = [&](int iteration, double value, double turn) {
    report_.steps.push_back({plan.width, plan.level, iteration, value, turn * kDegreesPerRadian});
    if (options_.progress) options_.progress(report_.steps.back(), work_.share(plan, iteration));
  };
  NODAL_TRY_ASSIGN(Descended found, descend(objective, heads_, sought,
                                            held_on(plan, why_not_, options_.geometry, own_vignetting_), descent));
  heads_ = std::move(found.heads);
  work_.end_level(plan);
  return {};
}

Status Run::find_dull_heads() {
  NODAL_TRY_ASSIGN(const Detail detail, measure_detail(detail_plan(plans_), *frames_.pyramids, heads_,
                                                       placed_heads(why_not_), options_, workers_));
  for (std::size_t h = 0; h < heads_.size(); ++h) {
    const HeadDetail& head = detail.heads[h];
    loose_sigma_[h] = std::numeric_limits<double>::infinity();
    if (!why_not_[h].empty()) continue;
    if (head.shared_sr <= 0) {
      why_not_[h] = "with the prior's rotations and lenses it shares no rays with another head";
    } else if (head.rms < kDullRms) {
      why_not_[h] = "the rays it shares with other heads show no detail (smooth sky, fog, a bare wall)";
    }
    if (!why_not_[h].empty()) heads_[h] = unplaced(start_[h], heads_[h]);
  }
  return check_enough_placed(prior_, why_not_);
}

// Heads with right rotations agree on detail of some size: on the finest if they share a nodal point; only on coarser
// detail if objects are close and each head sees them from its own position.
Status Run::check_agreement() {
  std::optional<Detail> best;
  std::vector<double> pairs;
  agreement_.coarse_sigma.assign(heads_.size(), std::nullopt);
  for (const LevelPlan& plan : plans_) {
    if (&plan != &detail_plan(plans_) && (plan.level <= detail_plan(plans_).level || plan.width < kAgreementWidth))
      continue;
    NODAL_TRY_ASSIGN(Detail detail,
                     measure_detail(plan, *frames_.pyramids, heads_, placed_heads(why_not_), options_, workers_));
    for (std::size_t h = 0; h < heads_.size(); ++h) {
      const HeadDetail& head = detail.heads[h];
      if (!(head.agreement >= kClearAgreement && head.sigma_rad < std::numeric_limits<double>::infinity())) continue;
      agreement_.coarse_sigma[h] =
          Agreement::CoarseSigma{head.sigma_rad, plan.width / (2 * std::numbers::pi)};  // levels come coarse first
    }
    for (std::size_t h = 0; best && h < heads_.size(); ++h) {
      detail.heads[h].agreement = std::max(detail.heads[h].agreement, best->heads[h].agreement);
    }
    pairs.resize(detail.pairs.size(), -1);
    for (std::size_t p = 0; p < pairs.size(); ++p) {
      const PairSums& pair = detail.pairs[p];
      const bool tells = pair.solid_angle > kSmallOverlapSr * channels_of(options_) && pair.least_rms() >= kDullRms;
      pairs[p] = std::max(pairs[p], tells ? pair.correlation() : 1);
    }
    best = std::move(detail);
  }
  agreement_.apart = std::ranges::count_if(pairs, [](double agreement) { return agreement < kMinPairAgreement; });
  agreement_.wrong = disagreeing(*best, why_not_);
  agreement_.little_detail = with_little_detail(*best, placed_heads(why_not_));
  agreement_.of_head.clear();
  for (const auto& head : best->heads) agreement_.of_head.push_back(head.agreement);
  return registration::check_agreement(prior_, agreement_.wrong,
                                       static_cast<std::size_t>(std::ranges::count(why_not_, std::string())));
}

Status Run::check_placed(bool& changed) {
  changed = false;
  NODAL_TRY_ASSIGN(const Detail detail, measure_detail(detail_plan(plans_), *frames_.pyramids, heads_,
                                                       placed_heads(why_not_), options_, workers_));
  NODAL_TRY(check_agreement());
  double per_radian = pixels_per_radian(heads_);
  if (options_.width > 0) per_radian = std::min(per_radian, options_.width / (2 * std::numbers::pi));
  std::vector<double> off_px(heads_.size(), 0);
  for (std::size_t h = 0; h < heads_.size(); ++h) {
    if (!why_not_[h].empty()) continue;
    loose_sigma_[h] = detail.heads[h].sigma_rad;
    double precision = per_radian;
    if (loose_sigma_[h] == std::numeric_limits<double>::infinity() && agreement_.coarse_sigma[h]) {
      // Fine detail does not line up, because of a wrong lens or close objects; coarser detail does. No seam can be
      // better than that, so the head is as precise as its pixels there.
      loose_sigma_[h] = agreement_.coarse_sigma[h]->rad;
      precision = std::min(precision, agreement_.coarse_sigma[h]->per_radian);
    }
    off_px[h] = loose_sigma_[h] * precision;
  }
  // A head that is much looser than others makes its neighbours loose: they are judged again without it.
  const double loosest = std::ranges::max(off_px);
  for (std::size_t h = 0; h < heads_.size(); ++h) {
    if (!(off_px[h] > kLooseSigmaPx) || off_px[h] < kMuchLooser * loosest) continue;
    heads_[h] = unplaced(start_[h], heads_[h]);
    why_not_[h] = "it shows much less detail than the other heads, too little for a rotation";
    if (!agreement_.little_detail[h]) {
      why_not_[h] = "the detail it shares with other heads does not determine its rotation in every direction";
      if (options_.width > 0) why_not_[h] += "; a wider raymap shows more of it";
    }
    loose_[h] = !agreement_.little_detail[h];
    changed = true;
  }
  return check_enough_placed(prior_, why_not_);
}

// Heads that are not placed were ignored so far. This estimates their light, with the prior's rotations.
Status Run::light_unplaced_heads() {
  if (!options_.gains || std::ranges::all_of(why_not_, &std::string::empty)) return {};
  const LevelPlan& plan = detail_plan(plans_);
  NODAL_TRY_ASSIGN(std::unique_ptr<Level> level,
                   Level::make(plan, Level::Pictures::kLight, *frames_.pyramids, heads_, options_, 0.02, workers_));
  Sought gains;
  gains.rotation = gains.vignetting = false;
  gains.channels = channels_of(options_);
  NODAL_TRY_ASSIGN(const Normal start, level->objective().evaluate(heads_, gains, false));
  level->objective().set_huber(static_cast<float>(kHuberShare * std::sqrt(start.objective())));
  Held held;
  held.geometry.assign(heads_.size(), true);
  held.free_gains = true;
  for (std::size_t h = 0; h < heads_.size(); ++h) held.light.push_back(why_not_[h].empty() || start.shared[h] <= 0);
  // Their fall-offs change by the mean change of the other heads.
  std::array<double, 3> change{};
  const auto placed = static_cast<double>(std::ranges::count(why_not_, std::string()));
  for (std::size_t h = 0; h < heads_.size(); ++h) {
    if (!why_not_[h].empty()) continue;
    for (std::size_t k = 0; k < 3; ++k) change[k] += (heads_[h].vignetting[k] - start_[h].vignetting[k]) / placed;
  }
  for (std::size_t h = 0; h < heads_.size(); ++h) {
    if (why_not_[h].empty()) continue;
    for (std::size_t k = 0; k < 3; ++k) heads_[h].vignetting[k] = start_[h].vignetting[k] + change[k];
  }
  NODAL_TRY_ASSIGN(Descended found, descend(level->objective(), heads_, gains, held, {}));
  heads_ = std::move(found.heads);
  return {};
}

Result<Certainty> Run::certainty(Level& level, const LevelPlan& plan) const {
  level.objective().set_used(placed_heads(why_not_));
  level.objective().set_huber(huber_);
  return certainty_of(level.objective(), heads_, sought_of(plan, options_),
                      held_on(plan, why_not_, options_.geometry, own_vignetting_), level.pixels_a_sample(),
                      options_.gauge == Gauge::kFirstHead ? std::vector<bool>() : placed_heads(why_not_), workers_);
}

Result<Report> Run::report() {
  const LevelPlan& finest = plans_.back();
  double farthest = 0;
  for (std::size_t h = 0; h < heads_.size(); ++h) {
    farthest = std::max(farthest, heads_[h].q_head_rig.angularDistance(start_[h].q_head_rig));
  }
  NODAL_TRY_ASSIGN(std::unique_ptr<Level> level, Level::make(finest, Level::Pictures::kLight, *frames_.pyramids, start_,
                                                             options_, farthest + 0.02, workers_));
  const Result<Normal> before = level->objective().evaluate(start_, sought_of(finest, options_), false);
  const Result<Normal> after = level->objective().evaluate(heads_, sought_of(finest, options_), false);
  if (!before) return fail(before.error());
  if (!after) return fail(after.error());
  report_.objective_before = before->objective();
  report_.objective_after = after->objective();
  NODAL_TRY_ASSIGN(const Certainty sure, certainty(*level, finest));
  const Certainty& certainty = sure;
  level.reset();  // what follows makes levels of its own
  const std::vector<bool> all(heads_.size(), true);
  NODAL_TRY_ASSIGN(const Detail detail,
                   measure_detail(detail_plan(plans_), *frames_.pyramids, heads_, all, options_, workers_));
  NODAL_TRY_ASSIGN(const Explanation explanation, check_cause(certainty));
  const std::vector<bool> little_detail = with_little_detail(detail, placed_heads(why_not_));
  report_.calibration = prior_;
  if (options_.distance) {
    const double nearness = heads_.front().nearness;
    report_.calibration.distance = nearness > 1 / kLongestDistance ? 1 / nearness : 0;
    report_.sigma_nearness = certainty.nearness;
  }
  const int n = static_cast<int>(heads_.size());
  std::vector<PairReport> doubtful;
  for (int h = 0; h < n; ++h) {
    const auto i = static_cast<std::size_t>(h);
    report_.calibration.heads[i] = heads_[i].into(prior_.heads[i]);
    const bool held = geometry::hold_light(report_.calibration.heads[i]);
    const bool stays = !why_not_[i].empty() || !options_.geometry;
    if (stays) report_.calibration.heads[i].R_head_rig = prior_.heads[i].R_head_rig;  // to the bit
    HeadReport head;
    head.name = prior_.heads[i].name;
    head.placed = why_not_[i].empty();
    head.why_not = why_not_[i];
    head.turned_deg = heads_[i].q_head_rig.angularDistance(start_[i].q_head_rig) * kDegreesPerRadian;
    // A real descent with other parameters says more than a linear step to its result.
    const double bias = certainty.bias_rad[i], turn = explanation.turns.empty() ? 0 : explanation.turns[i];
    const double sigma = turn > bias ? std::hypot(std::sqrt(std::pow(certainty.rotation_rad[i], 2) - bias * bias), turn)
                                     : certainty.rotation_rad[i];
    head.sigma_deg = (head.placed ? sigma : loose_sigma_[i]) * kDegreesPerRadian;
    head.focal_change_percent = 100 * (focal_of(heads_[i].lens) / focal_of(start_[i].lens) - 1);
    head.sigma_focal_percent = 100 * certainty.log_focal[i];
    head.shared_sr = detail.heads[i].shared_sr;
    if (!head.placed) report_.warnings.push_back("head '" + head.name + "' is not placed: " + head.why_not);
    if (head.placed && little_detail[i]) report_.warnings.push_back(weak_head(head));
    if (held) report_.warnings.push_back(held_light(head.name));
    report_.heads.push_back(std::move(head));
    for (int b = h + 1; b < n; ++b) {
      const std::size_t p = after->pair(h, b);
      if (after->pairs[p].measure <= 0) continue;
      report_.pairs.push_back({h, b, after->pairs[p].solid_angle / static_cast<double>(channels_of(options_)),
                               before->pairs[p].rms(), after->pairs[p].rms(), detail.pairs[p].correlation()});
      const auto j = static_cast<std::size_t>(b);
      const bool both = why_not_[i].empty() && why_not_[j].empty();
      if (both && report_.pairs.back().agreement < kMinPairAgreement &&
          report_.pairs.back().shared_sr > kSmallOverlapSr) {
        doubtful.push_back(report_.pairs.back());
      }
    }
  }
  if (rival_) report_.warnings.push_back(things_repeat(prior_.heads[rival_->head].name, rival_->turned));
  if (!doubtful.empty()) {
    report_.warnings.push_back(doubtful_seams(prior_, doubtful, cause_ != Cause::kNone));
  }
  NODAL_TRY(check_calibration(report_.calibration));
  return std::move(report_);
}

Result<Report> Run::run(const LitFrames& frames) {
  NODAL_TRY(prepare(frames));
  if (!options_.geometry) {
    for (const LevelPlan& plan : plans_) {
      NODAL_TRY(descend_level(plan));
    }
    return report();
  }
  NODAL_TRY(find_dull_heads());
  NODAL_TRY(descend_coarse());
  if (options_.search) NODAL_TRY(check_rivals());
  NODAL_TRY(descend_fine());
  bool changed = false;
  for (std::size_t round = 0; round < heads_.size(); ++round) {
    NODAL_TRY(check_placed(changed));
    if (!changed) break;
    NODAL_TRY(descend_level(plans_.back()));
  }
  // The head that held the rig may have been found not to be placed, after it had turned all others.
  hold_together(options_.gauge, start_, placed_heads(why_not_), heads_);
  NODAL_TRY(light_unplaced_heads());
  return report();
}

}  // namespace nodal::registration
