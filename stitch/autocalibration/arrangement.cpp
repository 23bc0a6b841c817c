#include "stitch/autocalibration/arrangement.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "protocol/base/angles.h"
#include "stitch/autocalibration/bundle.h"
#include "stitch/autocalibration/lens_choice.h"
#include "stitch/parallel/part_of.h"
#include "stitch/parallel/workers.h"
#include "stitch/registration/pair_start.h"

namespace nodal::autocalibration {
namespace {

using Eigen::Matrix3d;

constexpr double kTolerance = 0.015;  // units of radius: how far a tried lens may be off
constexpr int kMin = 8;               // matches that must agree to connect two heads
constexpr double kMinShare = 0.12;    // share of two heads' matches that must agree to connect them
constexpr std::size_t kFinalists = 5;
constexpr std::size_t kCompared = 3000;  // matches by which they are compared
constexpr double kTolerances = 6;        // standard deviations within which a match agrees with a fit
constexpr double kThinStep = 1.25;       // degrees between lenses that are tried: two rims then agree within kTolerance
constexpr double kCircle = 0.98;         // share of an image circle's radius at which a fisheye's angle is judged
constexpr double kWidestFisheye = 142 * kRadiansPerDegree;  // angle from the axis; the widest fisheyes see 280 degrees
constexpr std::array<double, 2> kSigma{0.3, 0.15};  // standard deviations of the two coefficients around the tried lens
constexpr double kSameFocal = 0.1;    // relative difference that the cameras' statements of equal lenses may have
constexpr double kShiftSigma = 0.02;  // standard deviation of the lens's axis, units of radius
// Standard deviations for a fisheye, between equisolid and stereographic.
constexpr std::array<double, 2> kFisheyeSigma{0.05, 0.01};

/// The lenses that are tried. With circles: fisheyes with this angle at the circle. Without: this angle at the middle
/// of the picture's shorter edges, for a rectilinear lens (tan a = a + a^3/3 + 2 a^5/15 ...), an equidistant one, and
/// one between them. The first ones have the focal length that the camera stated, if it did.
std::vector<SharedLens> tried_lenses(bool circles, bool anamorphic, std::optional<double> stated, Overlap overlap) {
  std::vector<SharedLens> all;
  for (const double part : {0.5, 1.0, 0.0}) {
    if (stated) all.push_back({{*stated, {part / 3, part * 2 / 15}}});
  }
  const double step = overlap == Overlap::kThin ? kThinStep : 5;
  for (double angle = 60; circles && angle <= 135; angle += step)
    all.push_back({{1 / (angle * kRadiansPerDegree), {}}});
  for (double angle = 8; !circles && angle <= 105; angle *= 1.12) {
    const double a = angle * kRadiansPerDegree;
    all.push_back({{1 / a, {}}});
    for (const double part : {0.5, 1.0}) {
      if (angle > 60) break;
      const double k1 = part / 3, k2 = part * 2 / 15;
      all.push_back({{1 / (a * (1 + a * a * (k1 + a * a * k2))), {k1, k2}}});
    }
  }
  const std::size_t square = all.size();
  for (const double aspect : {1.09, 0.915}) {  // 525 and 625 lines
    for (std::size_t n = 0; anamorphic && n < square; ++n) {
      all.push_back(all[n]);
      all.back().aspect = aspect;
    }
  }
  return all;
}

// The sizes of ITU-R BT.601 and their halves, whose pixels are not square.
bool may_be_anamorphic(const Shape& shape) {
  const bool width = shape.width == 720 || shape.width == 704 || shape.width == 352 || shape.width == 360;
  return width && (shape.height == 480 || shape.height == 576 || shape.height == 240 || shape.height == 288);
}

// The focal length that the cameras state, units, if most do and agree. Not used for fisheyes with circles, which say
// more.
std::optional<double> stated_focal(const std::vector<Shape>& shapes) {
  std::vector<double> stated;
  for (const Shape& shape : shapes) {
    if (shape.focal_px && !shape.circle) stated.push_back(*shape.focal_px / shape.unit());
  }
  if (2 * stated.size() <= shapes.size()) return std::nullopt;
  const auto [least, most] = std::ranges::minmax(stated);
  if (most > least * (1 + kSameFocal)) return std::nullopt;
  return (least + most) / 2;
}

struct Start {
  BundleState state;
  std::size_t first = 0;
  int agreeing = 0;
};

Start start_with(const SharedLens& lens, const std::vector<UnitMatch>& matches, std::size_t heads, const Trust& trust) {
  Start start{{lens, std::vector<std::optional<Matrix3d>>(heads)}, 0, 0};
  const Result<LensRays> rays = LensRays::make(lens);
  if (!rays) return start;
  std::vector<registration::RayPair> pairs;
  for (const UnitMatch& match : matches) {
    const auto a = rays->ray(match.at_a), b = rays->ray(match.at_b);
    if (a && b) pairs.push_back({match.a, match.b, *a, *b});
  }
  registration::PairRules rules{kTolerance / lens.model.focal, kMin, kMinShare};
  if (trust) {
    rules.trust = [&](std::size_t a, std::size_t b, const Matrix3d& R_b_a) { return trust(a, b, R_b_a, lens); };
  }
  const std::vector<Matrix3d> R(heads, Matrix3d::Identity());
  registration::PairStart found = registration::start_from_pairs(R, pairs, rules);
  start.first = found.first;
  start.state.R_head_rig = std::move(found.R_head_rig);
  start.agreeing = found.agreeing;
  return start;
}

/// Whether fisheyes with this angle at the circle are built.
bool is_built(const SharedLens& lens) {
  const Result<LensRays> rays = LensRays::make(lens);
  const std::optional<double> edge = rays ? rays->angle(kCircle) : std::nullopt;
  return edge && *edge < kWidestFisheye;
}

Arrangement arrangement_of(const BundleFit& best, const LensEvidence& evidence, const std::vector<Match>& matches) {
  Arrangement found{best.state.lens, best.state.own, evidence, best.state.R_head_rig, {}, best.error};
  std::vector<int> counts(found.R_head_rig.size());
  for (std::size_t m = 0; m < matches.size(); ++m) {
    if (!best.used[m]) continue;
    found.used.push_back(matches[m]);
    ++counts[matches[m].a];
    ++counts[matches[m].b];
  }
  for (std::size_t h = 0; h < counts.size(); ++h) {
    if (counts[h] < kMin) found.R_head_rig[h].reset();
  }
  return found;
}

Error not_built() {
  return {Errc::kNoCoverage, "the points that the pictures seem to have in common fit no lens that is built"};
}

/// Evenly chosen matches, as many as suffice to compare starts.
std::vector<UnitMatch> thinned(const std::vector<UnitMatch>& matches) {
  const std::size_t step = 1 + matches.size() / kCompared;
  std::vector<UnitMatch> some;
  for (std::size_t m = 0; m < matches.size(); m += step) some.push_back(matches[m]);
  return some;
}

/// How many matches agree with each fit, within the tolerance of the most accurate one; near misses count in part.
std::vector<double> scores_of(const std::vector<BundleFit>& fits) {
  double noise = fits.front().noise;
  for (const BundleFit& fit : fits) noise = std::min(noise, fit.noise);
  const double tolerance = kTolerances * noise;
  std::vector<double> scores;
  for (const BundleFit& fit : fits) {
    double score = 0;
    for (const double error : fit.errors) score += std::max(0.0, 1 - std::pow(error / tolerance, 2));
    scores.push_back(score);
  }
  return scores;
}

}  // namespace

SharedLens Arrangement::lens_of(std::size_t head) const { return BundleState{lens, {}, own}.lens_of(head); }

geometry::Pixel Shape::center() const {
  return circle ? geometry::Pixel{circle->x, circle->y} : geometry::Pixel{width / 2.0, height / 2.0};
}

double Shape::unit() const { return circle ? circle->radius : std::max(width, height) / 2.0; }

Result<Arrangement> find_arrangement(const std::vector<Shape>& shapes, const std::vector<Match>& matches, int threads,
                                     const Checks& checks, Overlap overlap,
                                     const std::function<void(double)>& progress) {
  const auto tell = [&](double done) {
    if (progress) progress(done);
  };
  const std::vector<UnitMatch> units = in_units(shapes, matches);
  const bool circles = std::ranges::all_of(shapes, [](const Shape& shape) { return shape.circle.has_value(); });
  const bool anamorphic = 2 * std::ranges::count_if(shapes, may_be_anamorphic) > std::ssize(shapes);
  const std::optional<double> stated = stated_focal(shapes);
  const BundleRules rules{{}, 0, anamorphic, circles ? kFisheyeSigma : kSigma, kShiftSigma, stated.value_or(0)};
  const std::vector<SharedLens> lenses = tried_lenses(circles, anamorphic, stated, overlap);
  const auto rules_for = [&](const Start& start, const SharedLens& prior) {
    BundleRules own = rules;
    own.first = start.first;
    own.prior = prior;
    return own;
  };
  std::vector<Start> starts(lenses.size());
  const parallel::Workers workers(threads);
  const auto try_lens = [&](int i) {
    const auto n = static_cast<std::size_t>(i);
    starts[n] = start_with(lenses[n], units, shapes.size(), checks.quick);
  };
  workers.run(static_cast<int>(lenses.size()), try_lens, parallel::part_of(progress, 0, 0.4));
  std::ranges::stable_sort(starts, [](const Start& a, const Start& b) { return a.agreeing > b.agreeing; });
  if (starts.front().agreeing == 0) {
    return fail(Errc::kNoCoverage, "no two pictures show the same things");
  }
  starts.resize(std::min(starts.size(), kFinalists));
  std::vector<BundleFit> fits(starts.size());
  const std::vector<UnitMatch> some = thinned(units);
  const auto fit = [&](int i) {
    const auto n = static_cast<std::size_t>(i);
    fits[n] = adjust(starts[n].state, some, rules_for(starts[n], starts[n].state.lens));
  };
  workers.run(static_cast<int>(starts.size()), fit, parallel::part_of(progress, 0.4, 0.2));
  std::vector<double> scores = scores_of(fits);
  for (std::size_t n = 0; n < fits.size(); ++n) {
    if (circles && !is_built(fits[n].state.lens)) scores[n] = -1;
  }
  const auto chosen = static_cast<std::size_t>(std::ranges::max_element(scores) - scores.begin());
  if (scores[chosen] < 0) {
    return fail(not_built());
  }
  BundleState state = fits[chosen].state;
  std::size_t first = starts[chosen].first;
  if (checks.thorough) {
    // With a good lens the pictures themselves can be compared, and the rotations are found once more.
    Start again = start_with(state.lens, units, shapes.size(), checks.thorough);
    if (again.agreeing == 0) {
      return fail(
          Errc::kNoCoverage,
          "where the points that the pictures seem to have in common would put them, they show different things");
    }
    state = std::move(again.state);
    first = again.first;
  }
  tell(0.7);
  BundleRules last = rules_for(starts[chosen], starts[chosen].state.lens);
  last.first = first;
  const LensChoice choice = choose_lens(state, units, last, workers);
  tell(0.9);
  const BundleFit best =
      choice.evidence.mostly() ? with_own_lenses(choice.fit, units, choice.rules, workers) : choice.fit;
  if (circles && !is_built(best.state.lens)) return fail(not_built());
  if (circles && choice.evidence.nowhere()) {
    return fail(Errc::kNoCoverage,
                "the few points that the pictures have in common do not determine the fisheyes' lens anywhere");
  }
  return arrangement_of(best, choice.evidence, matches);
}

}  // namespace nodal::autocalibration
