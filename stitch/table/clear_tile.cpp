#include "stitch/table/clear_tile.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "stitch/geometry/biquadratic.h"
#include "stitch/table/head_weight.h"
#include "stitch/table/seam.h"

namespace nodal::table {
namespace {

constexpr int kSide = blend::kTile;
using Polynomial = geometry::Biquadratic<3, kSide>;

/// All rays of a tile: those closer to `middle` than `radius`, rad.
struct Cone {
  geometry::Ray middle;
  double radius;
};

std::optional<Cone> cone_of(const RaySampler& sampler, int grid, int left, int top) {
  const RaySampler::Grid& shape = sampler.grids()[static_cast<std::size_t>(grid)];
  if (!sampler.layout().smooth() || left + kSide > shape.width || top + kSide > shape.height) return std::nullopt;
  const std::optional<geometry::Ray> middle = sampler.ray(grid, left + 3.5, top + 3.5);
  if (!middle) return std::nullopt;
  double chord = 0;
  for (const int x : {left, left + kSide - 1}) {
    for (const int y : {top, top + kSide - 1}) {
      const std::optional<geometry::Ray> corner = sampler.ray(grid, x, y);
      if (!corner) return std::nullopt;  // faces are convex: with its corners, the whole tile is in one
      chord = std::max(chord, (corner->direction() - middle->direction()).norm());
    }
  }
  constexpr double kMargin = 1.25;  // sides of a tile may be bent
  return Cone{*middle, kMargin * 2 * std::asin(std::min(1.0, chord / 2))};
}

/// Whether some ray of the cone may be in the head's region.
bool may_see(const RaySampler& sampler, HeadIndex head, const Cone& cone) {
  const geometry::Head& h = sampler.heads()[head];
  const RaySampler::Optics& optics = sampler.optics()[head];
  const double radius = cone.radius * h.magnification();
  const double reach = std::acos(std::clamp(optics.cos_reach, -1.0, 1.0)) + radius;
  return reach >= std::numbers::pi || optics.axis.dot(h.seen_from_here(cone.middle.direction())) >= std::cos(reach);
}

/// Whether head `a`, of the larger score, has the whole weight against `b` all over the cone, by the distance of the
/// cone's middle from their seam (seam.h), to first order. Where the slopes happen to be small, a part of their limits
/// counts instead.
bool far_from_seam(const RaySampler& sampler, const Cone& cone, double width, HeadIndex a, double a_score, HeadIndex b,
                   double b_score) {
  constexpr double kPart = 0.25, kMargin = 1.25;
  const Eigen::Vector2d a_slope = sampler.score_slope(a, cone.middle, a_score);
  const Eigen::Vector2d b_slope = sampler.score_slope(b, cone.middle, b_score);
  const double limit = b_score * sampler.steepest(a) + a_score * sampler.steepest(b);
  const double slope = std::max((b_score * a_slope - a_score * b_slope).norm(), kPart * limit);
  const double distance = (a_score - b_score) * (a_score + b_score) / (2 * slope);
  return distance >= kMargin * (width / 2 + cone.radius);
}

/// The head that has the whole weight of all rays of the cone.
std::optional<HeadIndex> only_head(const RaySampler& sampler, const Cone& cone) {
  std::array<double, kMaxHeads> scores{};
  const std::size_t heads = sampler.heads().size();
  for (std::size_t h = 0; h < heads; ++h) {
    const std::optional<HeadSight> seen = sampler.sight(static_cast<HeadIndex>(h), cone.middle);
    if (seen) scores[h] = score_of(*seen, sampler.optics()[h].depth_per_px);
  }
  const auto best = static_cast<HeadIndex>(std::ranges::max_element(scores) - scores.begin());
  // The scores that are least favourable within the cone.
  const auto limits = [&](HeadIndex head) {
    const double slope = sampler.steepest(head);
    return ScoreLimits{scores[head] - slope * cone.radius, scores[head] + slope * cone.radius, slope};
  };
  const ScoreLimits of_best = limits(best);
  if (!(of_best.least > 0 && of_best.most * of_best.most < kEndless)) return std::nullopt;
  const double width = sampler.options().seam_width_deg * std::numbers::pi / 180;
  for (std::size_t k = 0; k < heads; ++k) {
    const auto h = static_cast<HeadIndex>(k);
    if (h == best || !may_see(sampler, h, cone) || beyond_ramp(of_best, limits(h), width)) continue;
    if (scores[h] > 0 && far_from_seam(sampler, cone, width, best, scores[best], h, scores[h])) continue;
    return std::nullopt;
  }
  return best;
}

/// The values at all pixels of the tile, from those at the polynomial's nodes.
void evaluate(const Polynomial& polynomial, ClearTile& tile) {
  static const std::array<Eigen::Vector3d, kSide> kWeights = [] {
    std::array<Eigen::Vector3d, kSide> weights;
    for (std::size_t k = 0; k < kSide; ++k) weights[k] = Polynomial::weights(static_cast<double>(k));
    return weights;
  }();
  const std::array<double*, 3> into{tile.x.data(), tile.y.data(), tile.gain.data()};
  for (int n = 0; n < 3; ++n) {
    std::array<Eigen::Vector3d, kSide> columns;  // the three rows of nodes, at every column
    for (std::size_t i = 0; i < kSide; ++i) {
      for (std::size_t b = 0; b < 3; ++b) {
        double sum = 0;
        for (std::size_t a = 0; a < 3; ++a) sum += kWeights[i][static_cast<int>(a)] * polynomial.nodes[3 * b + a][n];
        columns[i][static_cast<int>(b)] = sum;
      }
    }
    double* const values = into[static_cast<std::size_t>(n)];
    for (std::size_t j = 0; j < kSide; ++j) {
      const Eigen::Vector3d& down = kWeights[j];
      for (std::size_t i = 0; i < kSide; ++i) {
        values[kSide * j + i] = down[0] * columns[i][0] + down[1] * columns[i][1] + down[2] * columns[i][2];
      }
    }
  }
}

}  // namespace

std::optional<ClearTile> clear_tile(const RaySampler& sampler, int grid, int left, int top) {
  if (sampler.options().transition == Transition::kFeather) return std::nullopt;
  const std::optional<Cone> cone = cone_of(sampler, grid, left, top);
  if (!cone) return std::nullopt;
  const std::optional<HeadIndex> head = only_head(sampler, *cone);
  if (!head) return std::nullopt;
  // Gains are fitted to about 1/1400 (TileBuilder::kGainFit); this makes kSamePlace an eighth of that.
  constexpr double kGainScale = 11;
  const RaySampler::Plane& plane = sampler.plane(grid, *head);
  const auto value = [&](double i, double j) -> std::optional<Polynomial::Value> {
    const std::optional<geometry::Ray> ray = sampler.ray(grid, left + i, top + j);
    const std::optional<HeadSight> seen = ray ? sampler.sight(*head, *ray) : std::nullopt;
    if (!seen || !sampler.stays(grid, *head, seen->pixel)) return std::nullopt;
    const RaySample at = sampler.place(grid, *head, seen->pixel);
    const bool moved = !(at.x > 0 && at.y > 0 && at.x < plane.width - 1 && at.y < plane.height - 1);
    return moved ? std::nullopt : std::optional(Polynomial::Value(at.x, at.y, kGainScale * at.gain));
  };
  const std::optional<Polynomial> fitted = Polynomial::fit(value, RaySampler::kSamePlace, Polynomial::kFourChecks);
  if (!fitted) return std::nullopt;
  ClearTile tile;
  tile.head = *head;
  evaluate(*fitted, tile);
  for (double& gain : tile.gain) gain /= kGainScale;
  return tile;
}

bool has_one_head_at_most(const RaySampler& sampler, int grid, int left, int top) {
  const std::optional<Cone> cone = cone_of(sampler, grid, left, top);
  if (!cone) return false;
  int heads = 0;
  for (std::size_t h = 0; h < sampler.heads().size(); ++h) {
    heads += may_see(sampler, static_cast<HeadIndex>(h), *cone) ? 1 : 0;
  }
  return heads <= 1;
}

}  // namespace nodal::table
