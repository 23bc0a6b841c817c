#include <algorithm>
#include <cmath>
#include <iterator>

#include "protocol/base/try.h"
#include "stitch/registration/check_frames.h"
#include "stitch/registration/run.h"
#include "stitch/registration/seen_radii.h"

namespace nodal::registration {
namespace {

// Certainty::by_parts from which on heads contradict each other; noise and blur stay below 0.045.
constexpr double kContradiction = 0.05;
constexpr double kStillContradictory = 0.03;  // the same with lenses estimated: then wrong ones leave less than 0.01
// Levels of 255, rms. Pictures that differ by less are equal but for rounding, which contradicts itself, too.
constexpr double kRounding = 0.5;
constexpr double kMostlyExplained = 0.5;  // remaining share of the contradictions, below which they count as explained
constexpr double kMostlyFocals = 0.7;     // share of what lenses explain, above which focal lengths are the cause

}  // namespace

// Goes on from the result with other parameters estimated: all lenses, or none, and the distance, or none. Lenses that
// are not estimated are the prior's; those that are have no soft priors.
Result<Run::Alternative> Run::attempt(bool lenses, bool distance) {
  const Options options = options_;
  const std::vector<HeadState> heads = heads_;
  const std::vector<Step> steps = report_.steps;
  const float huber = huber_;
  options_.progress = nullptr;
  options_.distance = distance;
  soft_priors_ = false;
  LevelPlan middle = detail_plan(plans_), finest = plans_.back();
  middle.focal = middle.lens = finest.focal = finest.lens = lenses;
  for (std::size_t h = 0; h < heads_.size() && !lenses; ++h) {
    heads_[h].lens = start_[h].lens;
    heads_[h].center_x = start_[h].center_x;
    heads_[h].center_y = start_[h].center_y;
  }
  Status done = descend_level(middle);
  if (done && finest.level != middle.level) done = descend_level(finest);
  Result<Alternative> found = fail(Errc::kNotDetermined, "not tried");
  if (done) {
    Result<std::unique_ptr<Level>> level =
        Level::make(finest, Level::Pictures::kLight, *frames_.pyramids, heads_, options_, 0.02, workers_);
    const Result<Certainty> sure = level ? certainty(**level, finest) : fail(level.error());
    if (sure) found = Alternative{sure->by_parts, heads_};
  }
  options_ = options;
  soft_priors_ = true;
  heads_ = heads;
  report_.steps = steps;
  huber_ = huber;
  return found;
}

// Why the heads do not agree everywhere. Wrong lenses are compensated by wrong rotations; so are near things, but other
// lenses explain these only in part, because displacements depend on what is seen, not on where in a picture it is.
Run::Explanation Run::explained(const Certainty& certainty) {
  Explanation found;
  const bool lenses = options_.free == Free::kLens;
  if (!options_.geometry || certainty.by_parts < (lenses ? kStillContradictory : kContradiction)) return found;
  const auto differs = [&](const Alternative& other) {
    found.turns.resize(heads_.size());
    for (std::size_t h = 0; h < heads_.size(); ++h) {
      const double turn = heads_[h].q_head_rig.angularDistance(other.heads[h].q_head_rig);
      if (why_not_[h].empty()) found.turns[h] = std::max(found.turns[h], turn);
    }
  };
  found.cause = Cause::kNearThings;
  if (!options_.distance && farthest_position(prior_) > 0) {
    const Result<Alternative> met = attempt(lenses, true);
    if (met) differs(*met);
    // One number that explains most is likelier than other lenses of all heads.
    if (met && met->by_parts < kMostlyExplained * certainty.by_parts) {
      found.nearness = met->heads.front().nearness;
      return found;
    }
  }
  // What is not estimated may be wrong, and what is estimated may have been used to compensate for near things.
  const Result<Alternative> other = attempt(!lenses, options_.distance);
  if (other) differs(*other);
  if (lenses || !other || other->by_parts > kStillContradictory) return found;
  found.cause = options_.free == Free::kRotations && certainty.by_focals > kMostlyFocals * certainty.by_lenses
                    ? Cause::kFocals
                    : Cause::kLenses;
  return found;
}

Result<Run::Explanation> Run::check_cause(const Certainty& certainty) {
  Explanation found = explained(certainty);
  if (report_.objective_after < kRounding * kRounding) found.cause = Cause::kNone;
  cause_ = found.cause;
  displaced_px_ = certainty.parts_px;
  if (cause_ == Cause::kNone) return found;
  if (cause_ == Cause::kNearThings) {
    NODAL_TRY_ASSIGN(const SeenRadii seen, seen_radii(prior_));
    const bool thin = seen.span > 0 && !seen.determine_lenses();
    report_.warnings.push_back(near_things(found.nearness, certainty.parts_px, prior_, thin));
    for (std::size_t h = 0; h < heads_.size(); ++h) {
      if (loose_[h])
        why_not_[h] =
            "no rotation makes it agree with its neighbours everywhere; it may see near things from its own position";
    }
    return found;
  }
  const bool focals = cause_ == Cause::kFocals;
  if (2 * std::ranges::count(loose_, true) > std::ssize(heads_)) {
    return fail(Errc::kHeadMismatch, wrong_lenses(focals));
  }
  report_.warnings.push_back(lens_misfit(focals, certainty.by_lenses, certainty.parts_px));
  return found;
}

}  // namespace nodal::registration
