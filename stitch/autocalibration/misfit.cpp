#include "stitch/autocalibration/misfit.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "protocol/base/angles.h"
#include "stitch/autocalibration/bundle.h"
#include "stitch/autocalibration/overlap.h"
#include "stitch/registration/pair_start.h"

namespace nodal::autocalibration {
namespace {

using Eigen::Matrix3d;

constexpr double kMisfitTolerance = 0.015;  // units of radius
constexpr int kMisfitMatches = 10;          // matches that must agree
constexpr double kMisfitShare = 0.15;       // share of the matches that must agree
constexpr double kMisfitCorrelation = 0.3;  // lowest correlation of the pictures' detail
constexpr double kClearly = 2;              // times as many matches agree as with equal lenses
constexpr double kRatioStep = 1.04;         // ratio of focal lengths that are tried one after the other
constexpr double kMaxRatio = 5;             // features are hardly found again at a larger one
constexpr double kMinRatio = 1.2;           // smaller ones may be an inexact lens
constexpr std::size_t kPairFeatures = 500;  // by which the pairs that are compared are chosen
constexpr std::size_t kComparedPairs = 3;   // pairs that are compared for each picture
constexpr std::size_t kMaxUnplaced = 8;     // pictures that are looked at, if some are placed

struct Fit {
  int agreeing = 0;
  Matrix3d R_b_a = Matrix3d::Identity();
};

/// The rotation on which most matches of two pictures agree, with these lenses. `matches`: a is 0, b is 1.
Fit fit_of(const std::vector<UnitMatch>& matches, const SharedLens& lens_a, const SharedLens& lens_b) {
  const Result<LensRays> rays_a = LensRays::make(lens_a), rays_b = LensRays::make(lens_b);
  if (!rays_a || !rays_b) return {};
  std::vector<registration::RayPair> pairs;
  for (const UnitMatch& match : matches) {
    const auto a = rays_a->ray(match.at_a), b = rays_b->ray(match.at_b);
    if (a && b) pairs.push_back({0, 1, *a, *b});
  }
  const double focal = std::max(lens_a.model.focal, lens_b.model.focal);
  const std::vector<Matrix3d> R(2, Matrix3d::Identity());
  registration::PairRules rules;
  rules.tolerance = kMisfitTolerance / focal;
  rules.least = kMisfitMatches;
  rules.least_share = kMisfitShare;
  const registration::PairStart found = registration::start_from_pairs(R, pairs, rules);
  if (found.agreeing == 0 || !found.R_head_rig[0] || !found.R_head_rig[1]) return {};
  return {found.agreeing, *found.R_head_rig[1] * found.R_head_rig[0]->transpose()};
}

DecodedImage mirrored(const DecodedImage& picture) {
  DecodedImage other = picture;
  const auto width = static_cast<std::size_t>(picture.width);
  for (std::size_t y = 0; y < static_cast<std::size_t>(picture.height); ++y) {
    const auto row = other.bytes.begin() + static_cast<std::ptrdiff_t>(y * width);
    std::reverse(row, row + static_cast<std::ptrdiff_t>(width));
  }
  return other;
}

Shape mirrored(Shape shape) {
  if (shape.circle) shape.circle->x = shape.width - shape.circle->x;
  for (auto& mask : shape.masks) {
    for (Region::Point& corner : mask) corner.x = shape.width - corner.x;
  }
  return shape;
}

std::vector<Feature> first_of(const std::vector<Feature>& features) {
  const std::size_t count = std::min(features.size(), kPairFeatures);
  return {features.begin(), features.begin() + static_cast<std::ptrdiff_t>(count)};
}

/// Lenses of all angles, between rectilinear and equidistant ones: near enough for a coarse fit.
std::vector<SharedLens> coarse_lenses(bool circles) {
  std::vector<SharedLens> all;
  for (double angle = 60; circles && angle <= 135; angle += 5) all.push_back({{1 / (angle * kRadiansPerDegree), {}}});
  for (double angle = 8; !circles && angle <= 60; angle *= 1.12) {
    const double a = angle * kRadiansPerDegree, k1 = 1.0 / 6, k2 = 1.0 / 15;
    all.push_back({{1 / (a * (1 + a * a * (k1 + a * a * k2))), {k1, k2}}});
  }
  return all;
}

/// One picture beside others, of which some may fit it.
class Comparison {
 public:
  Comparison(const MisfitSearch& search, std::vector<SharedLens> lenses)
      : search_(search), lenses_(std::move(lenses)) {}

  std::optional<Misfit> mirrored_beside(std::size_t picture, const std::vector<std::size_t>& others) const {
    const DecodedImage flipped = mirrored(search_.pictures[picture]);
    const Shape shape = mirrored(search_.shapes[picture]);
    const std::vector<Feature> features = features_of(flipped, shape), first = first_of(features);
    const auto alike = [&](std::size_t other) {
      return find_matches(0, first_of(search_.sight.features[other]), 1, first).size();
    };
    for (const std::size_t other : most_alike(others, alike)) {
      const std::vector<Match> matches = find_matches(0, search_.sight.features[other], 1, features);
      const Overlaps overlaps({search_.shapes[other], shape}, {search_.small[other], reduced(flipped, kEdgeSide)});
      const std::vector<UnitMatch> units = in_units({search_.shapes[other], shape}, matches);
      for (const SharedLens& lens : lenses_) {
        if (agrees(units, overlaps, lens, lens, 0)) return Misfit{Misfit::Cause::kMirrored, picture, other};
      }
    }
    return std::nullopt;
  }

  /// Not for fisheyes with circles: their unit is the circle's radius.
  std::optional<Misfit> other_focal_beside(std::size_t picture, const std::vector<std::size_t>& others) const {
    const auto matches_with = [&](std::size_t other) {
      std::vector<Match> matches;
      for (Match match : search_.sight.matches) {
        if (match.a == picture && match.b == other) std::swap(match.pixel_a, match.pixel_b);
        else if (match.a != other || match.b != picture) continue;
        match.a = 0, match.b = 1;
        matches.push_back(match);
      }
      return matches;
    };
    for (const std::size_t other : most_alike(others, [&](std::size_t one) { return matches_with(one).size(); })) {
      const Overlaps overlaps({search_.shapes[other], search_.shapes[picture]},
                              {search_.small[other], search_.small[picture]});
      const std::vector<UnitMatch> units =
          in_units({search_.shapes[other], search_.shapes[picture]}, matches_with(other));
      if (const double ratio = focal_ratio(units, overlaps); ratio > 0)
        return Misfit{Misfit::Cause::kFocal, picture, other, ratio};
    }
    return std::nullopt;
  }

 private:
  template <class Alike>
  static std::vector<std::size_t> most_alike(const std::vector<std::size_t>& others, const Alike& alike) {
    std::vector<std::pair<std::size_t, std::size_t>> by_count;
    for (const std::size_t other : others) by_count.emplace_back(alike(other), other);
    std::ranges::stable_sort(by_count, [](const auto& a, const auto& b) { return a.first > b.first; });
    std::vector<std::size_t> most;
    for (const auto& [count, other] : by_count) {
      if (most.size() < kComparedPairs && count > 0) most.push_back(other);
    }
    return most;
  }

  /// Whether more than `besides` matches agree on a rotation, and the pictures' detail with them.
  static bool agrees(const std::vector<UnitMatch>& units, const Overlaps& overlaps, const SharedLens& lens_a,
                     const SharedLens& lens_b, double besides) {
    const Fit fit = fit_of(units, lens_a, lens_b);
    return fit.agreeing > besides && fit.agreeing >= kMisfitMatches &&
           overlaps.correlation(0, 1, fit.R_b_a, lens_a, lens_b) > kMisfitCorrelation;
  }

  /// 0 if no ratio makes the pictures fit clearly better than equal focal lengths do.
  double focal_ratio(const std::vector<UnitMatch>& units, const Overlaps& overlaps) const {
    double equal = 0, best = 0, ratio = 0;
    for (const SharedLens& lens : lenses_) equal = std::max<double>(equal, fit_of(units, lens, lens).agreeing);
    for (const SharedLens& lens : lenses_) {
      for (double by = kMinRatio; by < kMaxRatio; by *= kRatioStep) {
        for (const double factor : {by, 1 / by}) {
          SharedLens other = lens;
          other.model.focal *= factor;
          const Fit fit = fit_of(units, lens, other);
          if (fit.agreeing <= best || overlaps.correlation(0, 1, fit.R_b_a, lens, other) <= kMisfitCorrelation)
            continue;
          best = fit.agreeing;
          ratio = factor;
        }
      }
    }
    return best > kClearly * equal ? ratio : 0;
  }

  const MisfitSearch& search_;
  std::vector<SharedLens> lenses_;
};

}  // namespace

std::vector<Misfit> misfits_of(const MisfitSearch& search, const Arrangement& arrangement) {
  std::vector<std::size_t> placed, unplaced;
  for (std::size_t n = 0; n < search.shapes.size(); ++n) {
    (arrangement.R_head_rig[n] ? placed : unplaced).push_back(n);
  }
  unplaced.resize(std::min(unplaced.size(), kMaxUnplaced));
  const Comparison comparison(search, {arrangement.lens});
  std::vector<std::optional<Misfit>> found(unplaced.size());
  search.workers.run(static_cast<int>(unplaced.size()), [&](int i) {
    const auto n = static_cast<std::size_t>(i);
    if (!search.shapes[unplaced[n]].circle) found[n] = comparison.other_focal_beside(unplaced[n], placed);
    if (!found[n]) found[n] = comparison.mirrored_beside(unplaced[n], placed);
  });
  std::vector<Misfit> misfits;
  for (const std::optional<Misfit>& one : found) {
    if (one) misfits.push_back(*one);
  }
  return misfits;
}

std::optional<Misfit> first_misfit(const MisfitSearch& search) {
  const std::size_t count = std::min(search.shapes.size(), kMaxCompared);
  const bool circles = search.shapes.front().circle.has_value();
  const Comparison comparison(search, coarse_lenses(circles));
  std::vector<std::optional<Misfit>> found(count);
  search.workers.run(static_cast<int>(count), [&](int i) {
    const auto n = static_cast<std::size_t>(i);
    std::vector<std::size_t> before;
    for (std::size_t other = 0; other < n; ++other) before.push_back(other);
    if (before.empty()) return;
    found[n] = comparison.mirrored_beside(n, before);
    if (!found[n] && !circles) found[n] = comparison.other_focal_beside(n, before);
  });
  const auto first = std::ranges::find_if(found, [](const auto& one) { return one.has_value(); });
  return first == found.end() ? std::nullopt : *first;
}

}  // namespace nodal::autocalibration
