#include "stitch/offline/seam_check.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <map>
#include <optional>
#include <tuple>
#include <utility>

#include "protocol/base/angles.h"
#include "protocol/base/try.h"
#include "stitch/geometry/head.h"
#include "stitch/offline/light_patch.h"
#include "stitch/solve/robust.h"
#include "stitch/table/tone_compiler.h"

namespace nodal::offline {
namespace {

using bands::Grid;
using Eigen::Vector3d;

constexpr int kSeamMapWidth = 1024;           ///< columns of the map on which a board's seams are found
constexpr std::size_t kMaxPlaces = 48;        ///< number of places of a seam
constexpr double kMinSpacing = kPi / 180;     ///< between places, rad
constexpr int kHalfPatch = 12;                ///< patches have 2 kHalfPatch + 1 pixels a side
constexpr int kCoarsePatch = 8;               ///< the same with pixels of four times the width
constexpr int kCoarsePixel = 4;               ///< the width of their pixels
constexpr int kNearShift = 3, kFarShift = 8;  ///< the largest shifts, in pixels and in coarse ones
constexpr double kMinShared = 0.4;            ///< share of a patch that both heads must see
constexpr double kMinDetail = 8;              ///< standard deviation of a patch with detail, levels
constexpr double kMinLikeness = 0.5;          ///< least correlation of patches that show the same thing
constexpr double kSureLikeness = 0.7;         ///< the same where leaves and water alone are alike by chance
constexpr double kMinCoherence = 0.45;        ///< least coherence of a patch with lines
constexpr double kMinGap = 20;                ///< least difference at a seam that is seen as an edge, levels
constexpr double kMinGapShare = 0.06;         ///< least share of the seam in a patch with such differences

/// Correlations at shifts, in pixels.
class TriedShifts {
 public:
  void add(int x, int y, const Likeness& at) {
    if (at.shared < kMinShared) return;
    tried_.push_back({std::hypot(x, y), at.correlation});
  }
  double best() const {
    double best = 0;
    for (const auto& [shift, correlation] : tried_) best = std::max(best, correlation);
    return best;
  }
  /// The least shift that is as good as the best one: along an edge many are.
  double least() const {
    const double enough = best() - std::max(0.02, 0.25 * (1 - best()));
    double least = 1e9;
    for (const auto& [shift, correlation] : tried_) {
      if (correlation >= enough) least = std::min(least, shift);
    }
    return least;
  }

 private:
  std::vector<std::pair<double, double>> tried_;
};

struct LookedAt {
  bool judged = false, detailed = false;
  SeamPlace seam;
  double step = 0;
};

/// Looks at places of the seams between two heads.
class Looker {
 public:
  Looker(const std::vector<HeadView>& heads, std::span<const ImageView> pictures, const MovedRay& moved,
         const SeamMap& map, Grid raymap)
      : heads_(heads), pictures_(heads.size()), moved_(moved), map_(map), raymap_pixel_(kPi / raymap.height) {
    for (std::size_t h = 0; h < heads.size(); ++h) {
      if (pictures[h].planes[0].data != nullptr) pictures_[h].emplace(heads[h], pictures[h]);
    }
  }

  LookedAt look(std::size_t a, std::size_t b, const Vector3d& axis) const {
    LookedAt place;
    const auto in_a = see(a, axis), in_b = see(b, axis);
    if (!in_a || !in_b) return place;
    const double pixel = std::max({raymap_pixel_, 1 / std::sqrt(in_a->density), 1 / std::sqrt(in_b->density)});
    const LightPatch patch = of(a, kHalfPatch, pixel, axis), other = of(b, kHalfPatch + kNearShift, pixel, axis);
    const Likeness here = likeness(patch, other, kHalfPatch, 0, 0);
    if (here.shared < kMinShared) return place;
    place.judged = true;
    place.step = here.step;
    place.seam.at = geometry::Ray::towards(axis).angles();
    place.seam.bent_px = (along(a, axis) - along(b, axis)).norm() / raymap_pixel_;
    place.detailed = here.detail >= kMinDetail;
    if (!place.detailed) return place;
    TriedShifts shifts;
    add_shifts(patch, other, 0, 0, shifts);
    if (shifts.best() < 0.9) look_farther(a, b, axis, pixel, patch, shifts);
    place.seam.alike = shifts.best() >= kMinLikeness;
    place.seam.jump_px =
        (place.seam.alike ? shifts.least() : kCoarsePixel * kFarShift + kNearShift) * pixel / raymap_pixel_;
    const double gap = gap_share(a, b, axis, pixel, patch, other);
    const double lines = std::max(coherence(patch), coherence(other));
    if (gap < kMinGapShare && !place.seam.alike) {
      place.seam.alike = true;
      place.seam.jump_px = 0;
    } else if (gap < kMinGapShare) {
      place.seam.jump_px = std::min(place.seam.jump_px, kBrokenPx);
    } else if (shifts.best() < kSureLikeness && lines < kMinCoherence) {
      place.detailed = false;
    }
    return place;
  }

 private:
  Vector3d along(std::size_t head, const Vector3d& ray) const { return moved_ ? moved_(head, ray) : ray; }
  std::optional<Sighting> see(std::size_t head, const Vector3d& ray) const {
    return pictures_[head] ? heads_[head].see(along(head, ray)) : std::nullopt;
  }
  LightPatch of(std::size_t head, int half, double pixel, const Vector3d& axis) const {
    return {half, pixel, axis, [&](const Vector3d& ray, double width) -> float {
              const auto seen = see(head, ray);
              if (!seen) return kNotSeen;
              std::array<float, 3> colours{};
              pictures_[head]->sample(*seen, width, colours.data());
              const bool grey = pictures_[head]->colours() == 1;
              const float light = grey ? colours[0] : 0.25F * colours[0] + 0.5F * colours[1] + 0.25F * colours[2];
              return std::max(0.0F, light);
            }};
  }

  /// The share of the seam between `a` and `b` along which their pictures differ so that an edge is seen, after the
  /// difference of their brightness, which the blend spreads.
  double gap_share(std::size_t a, std::size_t b, const Vector3d& axis, double pixel, const LightPatch& patch,
                   const LightPatch& other) const {
    const Vector3d right = (std::abs(axis.y()) > 0.9 ? Vector3d::UnitZ() : Vector3d::UnitY()).cross(axis).normalized();
    const Vector3d down = axis.cross(right);
    constexpr int kSide = 2 * kHalfPatch + 1;
    std::array<std::size_t, static_cast<std::size_t>(kSide) * kSide> owners{};
    const auto owner = [&](int i, int j) -> std::size_t& {
      return owners[static_cast<std::size_t>((j + kHalfPatch) * kSide + i + kHalfPatch)];
    };
    const auto off = [&](int i, int j) { return static_cast<double>(other.at(i, j) - patch.at(i, j)); };
    std::vector<seams::Share> shares;
    double step = 0, seen = 0;
    for (int j = -kHalfPatch; j <= kHalfPatch; ++j) {
      for (int i = -kHalfPatch; i <= kHalfPatch; ++i) {
        owner(i, j) = seams::kNobody;
        if (patch.at(i, j) < 0 || other.at(i, j) < 0) continue;
        const auto at = geometry::Ray::towards(axis + pixel * (i * right + j * down)).angles();
        seams::shares_at(map_.labels, map_.grid, (at.theta / (2 * kPi) + 0.5) * map_.grid.width,
                         (at.phi / kPi + 0.5) * map_.grid.height, shares);
        if (!shares.empty()) owner(i, j) = shares.front().head;
        step += off(i, j), ++seen;
      }
    }
    step /= std::max(1.0, seen);
    double along = 0, gaps = 0;
    const auto compare = [&](int i, int j, int k, int l) {
      if (std::minmax(owner(i, j), owner(k, l)) != std::minmax(a, b)) return;
      ++along;
      gaps += std::abs(off(i, j) - step) + std::abs(off(k, l) - step) > 2 * kMinGap;
    };
    for (int j = -kHalfPatch; j < kHalfPatch; ++j) {
      for (int i = -kHalfPatch; i < kHalfPatch; ++i) {
        compare(i, j, i + 1, j);
        compare(i, j, i, j + 1);
      }
    }
    return along > 0 ? gaps / along : 1;
  }

  static void add_shifts(const LightPatch& patch, const LightPatch& other, int x, int y, TriedShifts& shifts) {
    for (int j = -kNearShift; j <= kNearShift; ++j) {
      for (int i = -kNearShift; i <= kNearShift; ++i) {
        shifts.add(x + i, y + j, likeness(patch, other, kHalfPatch, i, j));
      }
    }
  }

  /// Finds the best coarse shift, then tries the fine ones around it.
  void look_farther(std::size_t a, std::size_t b, const Vector3d& axis, double pixel, const LightPatch& patch,
                    TriedShifts& shifts) const {
    const LightPatch coarse = of(a, kCoarsePatch, kCoarsePixel * pixel, axis);
    const LightPatch other = of(b, kCoarsePatch + kFarShift, kCoarsePixel * pixel, axis);
    double best = 0;
    int x = 0, y = 0;
    for (int j = -kFarShift; j <= kFarShift; ++j) {
      for (int i = -kFarShift; i <= kFarShift; ++i) {
        const Likeness at = likeness(coarse, other, kCoarsePatch, i, j);
        if (at.shared < kMinShared || at.correlation <= best) continue;
        best = at.correlation;
        x = i, y = j;
      }
    }
    if (x == 0 && y == 0) return;
    const Vector3d right = (std::abs(axis.y()) > 0.9 ? Vector3d::UnitZ() : Vector3d::UnitY()).cross(axis).normalized();
    const Vector3d direction = (axis + kCoarsePixel * pixel * (x * right + y * axis.cross(right))).normalized();
    add_shifts(patch, of(b, kHalfPatch + kNearShift, pixel, direction), kCoarsePixel * x, kCoarsePixel * y, shifts);
  }

  const std::vector<HeadView>& heads_;
  std::vector<std::optional<HeadPicture>> pictures_;
  const MovedRay& moved_;
  const SeamMap& map_;
  double raymap_pixel_;
};

using HeadPair = std::pair<std::size_t, std::size_t>;

/// The rays at which two neighbours on the map show different heads.
std::map<HeadPair, std::vector<Vector3d>> seams_of(const seams::Labels& labels, Grid map) {
  std::map<HeadPair, std::vector<Vector3d>> found;
  const auto label = [&](int x, int y) {
    return labels[static_cast<std::size_t>(y) * static_cast<std::size_t>(map.width) +
                  static_cast<std::size_t>(x % map.width)];
  };
  const auto add = [&](std::size_t a, std::size_t b, double u, double v) {
    if (a == b || a == seams::kNobody || b == seams::kNobody) return;
    found[std::minmax(a, b)].push_back(ray_of(map, u, v));
  };
  for (int y = 0; y < map.height; ++y) {
    for (int x = 0; x < map.width; ++x) {
      add(label(x, y), label(x + 1, y), x + 1, y + 0.5);
      if (y + 1 < map.height) add(label(x, y), label(x, y + 1), x + 0.5, y + 1);
    }
  }
  return found;
}

/// At most kMaxPlaces of the rays, at least `spacing` apart, rad.
std::vector<Vector3d> spaced(const std::vector<Vector3d>& rays, double spacing) {
  for (;; spacing *= 1.5) {
    std::vector<Vector3d> kept;
    for (const Vector3d& ray : rays) {
      const bool free =
          std::ranges::none_of(kept, [&](const Vector3d& other) { return (ray - other).norm() < spacing; });
      if (free) kept.push_back(ray);
      if (kept.size() > kMaxPlaces) break;
    }
    if (kept.size() <= kMaxPlaces) return kept;
  }
}

/// How many places are worse than a jump.
std::size_t worse(const SeamCheck& seam, double jump_px) {
  return static_cast<std::size_t>(std::ranges::count_if(
      seam.places, [&](const SeamPlace& place) { return !place.alike || place.jump_px > jump_px; }));
}

/// The head that shows each pixel of the map best, as a board's table has it.
seams::Labels best_heads(const std::vector<HeadView>& heads, std::span<const ImageView> pictures, Grid map,
                         const parallel::Workers& workers) {
  seams::Labels labels(static_cast<std::size_t>(map.width) * static_cast<std::size_t>(map.height), seams::kNobody);
  workers.run(map.height, [&](int y) {
    for (int x = 0; x < map.width; ++x) {
      double best = 0;
      for (std::size_t h = 0; h < heads.size(); ++h) {
        if (pictures[h].planes[0].data == nullptr) continue;
        const auto seen = heads[h].see(ray_of(map, x + 0.5, y + 0.5));
        if (!seen || seen->score <= best) continue;
        best = seen->score;
        labels[static_cast<std::size_t>(y) * static_cast<std::size_t>(map.width) + static_cast<std::size_t>(x)] =
            static_cast<std::uint8_t>(h);
      }
    }
  });
  return labels;
}

/// The number that all but kMaxWorseShare of the places stay below.
double usual(const SeamCheck& seam, double SeamPlace::*number) {
  if (seam.places.empty()) return 0;
  std::vector<double> numbers;
  for (const SeamPlace& place : seam.places) numbers.push_back(place.*number);
  std::ranges::sort(numbers);
  const auto above = static_cast<std::size_t>(kMaxWorseShare * static_cast<double>(numbers.size()));
  return numbers[numbers.size() - 1 - above];
}

}  // namespace

SeamVerdict verdict_of(const SeamCheck& seam) {
  const double many = kMaxWorseShare * static_cast<double>(seam.places.size());
  const std::size_t broken = worse(seam, kBrokenPx);
  const double step = std::abs(seam.step_levels);
  if ((broken > 1 && static_cast<double>(broken) > many) || step > kBrokenStep) return SeamVerdict::kLook;
  const bool jumps = static_cast<double>(worse(seam, kFinePx)) > many;
  if (jumps || step > kFineStep || usual_bend(seam) > kFineBendPx) return SeamVerdict::kUsable;
  return SeamVerdict::kGood;
}

SeamVerdict verdict_of(std::span<const SeamCheck> seams) {
  SeamVerdict worst = SeamVerdict::kGood;
  for (const SeamCheck& seam : seams) worst = std::max(worst, verdict_of(seam));
  return worst;
}

double usual_jump(const SeamCheck& seam) { return usual(seam, &SeamPlace::jump_px); }
double usual_bend(const SeamCheck& seam) { return usual(seam, &SeamPlace::bent_px); }

const SeamPlace* worst_place(const SeamCheck& seam) {
  const auto worst = std::ranges::max_element(
      seam.places, {}, [](const SeamPlace& place) { return std::tuple(!place.alike, place.jump_px, place.bent_px); });
  return worst == seam.places.end() ? nullptr : &*worst;
}

std::vector<SeamCheck> check_seams(const std::vector<HeadView>& heads, std::span<const ImageView> pictures,
                                   const MovedRay& moved, const SeamMap& map, Grid raymap,
                                   const parallel::Workers& workers) {
  const Looker looker(heads, pictures, moved, map, raymap);
  const double spacing = std::max(kMinSpacing, 2 * kHalfPatch * kPi / raymap.height);
  std::vector<SeamCheck> checks;
  for (const auto& [pair, rays] : seams_of(map.labels, map.grid)) {
    const auto [a, b] = pair;
    const std::vector<Vector3d> at = spaced(rays, spacing);
    std::vector<LookedAt> places(at.size());
    workers.run(static_cast<int>(at.size()), [&, a = a, b = b](int i) {
      const auto k = static_cast<std::size_t>(i);
      places[k] = looker.look(a, b, at[k]);
    });
    SeamCheck check{a, b, 0, {}, 0};
    std::vector<double> steps;
    for (const LookedAt& place : places) {
      if (!place.judged) continue;
      ++check.looked_at;
      steps.push_back(place.step);
      if (place.detailed) check.places.push_back(place.seam);
    }
    check.step_levels = solve::median(steps);
    checks.push_back(std::move(check));
  }
  return checks;
}

Result<std::vector<SeamCheck>> check_seams(const Calibration& calibration, std::span<const ImageView> pictures,
                                           Grid raymap, int threads) {
  NODAL_TRY_ASSIGN(const auto heads, geometry::make_heads(calibration));
  std::vector<ImageView> shown(pictures.begin(), pictures.end());
  std::vector<HeadView> views;
  for (std::size_t h = 0; h < heads.size(); ++h) {
    if (shown[h].format != PixelFormat::kRgb24) shown[h].format = PixelFormat::kGrey8;
    views.emplace_back(heads[h], shown[h].format, table::linear_power(calibration));
  }
  const parallel::Workers workers(threads);
  const int width = std::clamp(raymap.width / 2 * 2, 32, kSeamMapWidth);
  const Grid map{width, width / 2};
  const seams::Labels labels = best_heads(views, shown, map, workers);
  return check_seams(views, shown, {}, {labels, map}, raymap, workers);
}

}  // namespace nodal::offline
