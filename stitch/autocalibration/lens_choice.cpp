#include "stitch/autocalibration/lens_choice.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <numbers>
#include <tuple>

#include "stitch/solve/robust.h"

namespace nodal::autocalibration {
namespace {

constexpr double kFamilyPart = 0.03;  // standard deviation of lenses from their family, as a share of the radius
// Units of radius. If the range of seen radii is thinner, the lens must be closer to its family, because its difference
// from the family, and errors due to near things, are extrapolated.
constexpr double kWideRange = 0.3;
constexpr double kTold = 30;         // how much larger the chi squared of a family must be to exclude the family
constexpr double kOutlierChi = 36;   // chi squared of a match that counts as an outlier
constexpr double kKnownPart = 0.02;  // a radius is known if two standard deviations are at most this share of it
constexpr int kRadii = 200;
constexpr std::size_t kParts = 5;  // parts of the pairs of heads; each is left out once
// How far beyond the range of seen radii matches still determine the lens, towards the axis and away from it, as a
// share of that range.
constexpr double kInward = 1.5, kOutward = 0.25;
constexpr double kSeenTail = 0.02;  // share of the matches that is left out at either end of the range
// Standard deviation of a head's log focal length and axis, units, around the shared ones.
constexpr double kOwnSigma = 0.01;
constexpr double kClearlyBetter = 0.96;
constexpr int kFewestOfHead = 40;  // average matches of a head from which on heads may have own lenses

/// Chi squared of the matches that `counted` names; an outlier counts as kOutlierChi.
double chi_squared(const std::vector<double>& errors, const std::vector<bool>& counted, double noise) {
  double sum = 0;
  for (std::size_t m = 0; m < errors.size(); ++m) {
    if (counted[m]) sum += std::min(kOutlierChi, errors[m] * errors[m] / (noise * noise));
  }
  return sum;
}

std::vector<double> radii_used(const BundleFit& fit, const std::vector<UnitMatch>& matches) {
  std::vector<double> radii;
  for (std::size_t m = 0; m < matches.size(); ++m) {
    if (!fit.used[m]) continue;
    for (const auto& [head, at] :
         {std::pair(matches[m].a, matches[m].at_a), std::pair(matches[m].b, matches[m].at_b)}) {
      const SharedLens lens = fit.state.lens_of(head);
      radii.push_back(std::hypot(at.x() - lens.shift.x(), (at.y() - lens.shift.y()) / lens.aspect));
    }
  }
  std::ranges::sort(radii);
  return radii;
}

/// The range of sorted radii, at least one, without the share kSeenTail at each end.
std::pair<double, double> seen_range(const std::vector<double>& radii) {
  const auto tail = static_cast<std::size_t>(kSeenTail * static_cast<double>(radii.size()));
  return {radii[tail], radii[radii.size() - 1 - tail]};
}

/// The family's lens that has the start's angle at `radius`.
std::optional<SharedLens> lens_of_family(Family family, const SharedLens& start, double radius) {
  const Result<LensRays> rays = LensRays::make(start);
  const std::optional<double> angle = rays ? rays->angle(radius) : std::nullopt;
  SharedLens lens = start;
  lens.model = family_lens(family);
  const Result<LensRays> unit = LensRays::make(lens);
  const std::optional<double> expected = angle && unit ? unit->radius(*angle) : std::nullopt;
  if (!expected) return std::nullopt;
  lens.model.focal = radius / *expected;
  return lens;
}

/// The covariance of log focal, k1 and k2 by what they are without a part of the pairs of heads, in turn (the
/// jackknife). Errors that the matches of two heads have in common, such as those of near things, are in it and not in
/// the covariance of a fit. Zero for a few pairs.
Eigen::Matrix3d jackknife(const BundleFit& fit, const std::vector<UnitMatch>& matches, const BundleRules& rules,
                          const parallel::Workers& workers) {
  std::map<std::pair<std::size_t, std::size_t>, std::size_t> pairs;
  for (std::size_t m = 0; m < matches.size(); ++m) {
    if (fit.used[m]) pairs.try_emplace({matches[m].a, matches[m].b}, pairs.size());
  }
  if (pairs.size() < 2 * kParts) return Eigen::Matrix3d::Zero();
  std::array<Eigen::Vector3d, kParts> lenses;
  workers.run(static_cast<int>(kParts), [&](int i) {
    const auto part = static_cast<std::size_t>(i);
    std::vector<UnitMatch> others;
    for (std::size_t m = 0; m < matches.size(); ++m) {
      if (fit.used[m] && pairs.at({matches[m].a, matches[m].b}) % kParts != part) others.push_back(matches[m]);
    }
    const KannalaBrandtLens lens = adjust(fit.state, others, rules).state.lens.model;
    lenses[part] = {std::log(lens.focal), lens.k[0], lens.k[1]};
  });
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& lens : lenses) mean += lens / kParts;
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
  for (const Eigen::Vector3d& lens : lenses)
    covariance += (kParts - 1.0) / kParts * (lens - mean) * (lens - mean).transpose();
  return covariance;
}

/// Finds the radii at which the lens is known: they are near radii that have matches, and neither the fit's covariance,
/// nor the jackknife's, nor another family that is not excluded leaves more doubt than kKnownPart.
void find_known(const BundleFit& fit, const Eigen::Matrix3d& left_out, const std::vector<const BundleFit*>& others,
                LensEvidence& evidence) {
  const Result<LensRays> rays = LensRays::make(fit.state.lens);
  evidence.known_from = 1;
  evidence.known_to = 0;
  if (!rays) return;
  const double range = evidence.seen_to - evidence.seen_from;
  const double least = evidence.seen_from - kInward * range, most = evidence.seen_to + kOutward * range;
  double from = 0;
  bool within = false;
  for (int i = 0; i < kRadii; ++i) {
    const double radius = (i + 0.5) / kRadii;
    const std::optional<double> angle = rays->angle(radius);
    double unsure = 1;
    if (angle) {
      const double g = radius / fit.state.lens.model.focal;
      const Eigen::Vector3d by(1, std::pow(*angle, 3) / g, std::pow(*angle, 5) / g);
      unsure = 2 * std::sqrt(std::max({0.0, by.dot(fit.covariance * by), by.dot(left_out * by)}));
      for (const BundleFit* other : others) {
        const Result<LensRays> its = LensRays::make(other->state.lens);
        const std::optional<double> expected = its ? its->radius(*angle) : std::nullopt;
        // Any of the families that remain may be the true one.
        unsure = std::max(
            unsure, expected ? std::max(std::abs(*expected / radius - 1), std::abs(radius / *expected - 1)) : 1.0);
      }
    }

    evidence.unsure = std::max(evidence.unsure, unsure);
    const bool known = unsure < kKnownPart && radius > least && radius < most;
    if (known && !within) from = i == 0 ? 0 : static_cast<double>(i) / kRadii;
    within = known;
    const double to = static_cast<double>(i + 1) / kRadii;
    if (known && to - from > evidence.known_to - evidence.known_from) {
      evidence.known_from = from;
      evidence.known_to = to;
    }
  }
}

}  // namespace

LensChoice choose_lens(const BundleState& start, const std::vector<UnitMatch>& matches, const BundleRules& rules,
                       const parallel::Workers& workers) {
  const BundleFit first = adjust(start, matches, rules);
  const std::vector<double> radii = radii_used(first, matches);
  const Result<LensRays> rays = LensRays::make(first.state.lens);
  const std::optional<double> edge = rays ? rays->angle(1) : std::nullopt;
  struct Tried {
    Family family;
    BundleFit fit;
    BundleRules rules;
    double chi = 0;
  };
  std::vector<Tried> all;
  if (!radii.empty() && edge) {
    const auto [nearest, farthest] = seen_range(radii);
    const double thin = std::min(1.0, (farthest - nearest) / kWideRange);
    for (const Family family : families_reaching(*edge)) {
      const auto lens = lens_of_family(family, first.state.lens, radii[radii.size() / 2]);
      if (!lens) continue;
      BundleRules own = rules;
      own.prior = *lens;
      own.sigma = family_sigma(*edge, kFamilyPart * thin);
      own.shift_sigma *= thin;
      all.push_back({family, {}, own});
    }
    workers.run(static_cast<int>(all.size()), [&](int i) {
      Tried& one = all[static_cast<std::size_t>(i)];
      BundleState from = first.state;
      from.lens = one.rules.prior;
      one.fit = adjust(std::move(from), matches, one.rules);
    });
  }
  if (all.empty()) {
    LensEvidence none;
    if (radii.empty()) none.known_to = 0;
    return {first, rules, none};
  }
  double noise = all.front().fit.noise;
  for (const Tried& one : all) noise = std::min(noise, one.fit.noise);
  double least = std::numeric_limits<double>::infinity();
  std::vector<bool> counted(matches.size());
  for (const Tried& one : all) {
    for (std::size_t m = 0; m < counted.size(); ++m) counted[m] = counted[m] || one.fit.used[m];
  }
  for (Tried& one : all) {
    one.chi = chi_squared(one.fit.errors, counted, noise) + one.fit.held;
    least = std::min(least, one.chi);
  }
  const auto possible = [&](const Tried& one) { return one.chi < least + kTold; };

  const Tried& chosen = *std::ranges::find_if(all, possible);
  std::vector<const BundleFit*> others;
  for (const Tried& one : all) {
    if (&one != &chosen && possible(one)) others.push_back(&one.fit);
  }
  LensChoice choice{chosen.fit, chosen.rules, {}};
  choice.evidence.family = family_name(chosen.family);
  if (const std::vector<double> seen = radii_used(chosen.fit, matches); !seen.empty()) {
    std::tie(choice.evidence.seen_from, choice.evidence.seen_to) = seen_range(seen);
  }
  find_known(chosen.fit, jackknife(chosen.fit, matches, chosen.rules, workers), others, choice.evidence);
  return choice;
}

BundleFit with_own_lenses(const BundleFit& fit, const std::vector<UnitMatch>& matches, const BundleRules& rules,
                          const parallel::Workers& workers) {
  const auto heads = std::ranges::count_if(fit.state.R_head_rig, [](const auto& R) { return R.has_value(); });
  if (heads < 3 || std::ranges::count(fit.used, true) * 2 < kFewestOfHead * heads) return fit;
  BundleRules own = rules;
  own.own_sigma = kOwnSigma;
  own.prior = fit.state.lens;
  // Each half is fitted in both ways, and judged by the other half.
  std::array<std::vector<UnitMatch>, 2> halves;
  for (std::size_t m = 0; m < matches.size(); ++m) {
    if (fit.used[m]) halves[m % 2].push_back(matches[m]);
  }
  std::array<std::vector<double>, 4> errors;  // shared lenses, then own ones
  workers.run(4, [&](int i) {
    const auto n = static_cast<std::size_t>(i);
    const BundleRules& lenses = n / 2 == 0 ? rules : own;
    errors[n] = errors_of(adjust(fit.state, halves[n % 2], lenses).state, halves[1 - n % 2]);
  });
  const auto both = [&](std::size_t first) {
    std::vector<double> all = errors[first];
    all.insert(all.end(), errors[first + 1].begin(), errors[first + 1].end());
    return all;
  };
  std::vector<double> shared_errors = both(0), own_errors = both(2);
  if (solve::median(own_errors) > kClearlyBetter * solve::median(shared_errors)) return fit;
  return adjust(fit.state, matches, own);
}

}  // namespace nodal::autocalibration
