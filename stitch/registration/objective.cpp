#include "stitch/registration/objective.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "protocol/base/try.h"
#include "stitch/registration/head_sight.h"

namespace nodal::registration {
namespace {

// The number of chunks depends on the number of tiles only, so the order of additions does not depend on the threads.
int chunk_count(std::size_t tiles) { return static_cast<int>(std::clamp<std::size_t>(tiles / 32, 1, 16)); }

/// The faces of a cube around the sphere, each cut into 4 x 4.
std::size_t part_of(const Tile& tile) {
  const Eigen::Map<const Eigen::Vector3f> axis(tile.axis);
  Eigen::Index longest = 0;
  const float length = axis.cwiseAbs().maxCoeff(&longest);
  const auto cell = [&](Eigen::Index k) { return std::clamp(static_cast<int>(2 * (axis[k % 3] / length + 1)), 0, 3); };
  const auto face = static_cast<int>(2 * longest) + (axis[longest] > 0 ? 1 : 0);
  return static_cast<std::size_t>(16 * face + 4 * cell(longest + 1) + cell(longest + 2));
}

struct Workspace {
  std::vector<TileHead> heads;
  TileRays rays;
  alignas(64) float weight[kTile];
};

void add_derivatives(const std::vector<TileHead*>& seen, const std::vector<HeadSight>& sights,
                     const std::vector<Slots>& slots, int channel, Workspace& work, Normal& sums) {
  const int K = sums.slots;
  for (TileHead* head : seen) {
    const auto h = static_cast<std::size_t>(head->head);
    differentiate(sights[h], slots[h], channel, *head);
  }
  differentiate_by_others(sights, slots, seen.data(), static_cast<int>(seen.size()));
  const auto count = [&](const TileHead* head) { return slots[static_cast<std::size_t>(head->head)].count; };
  for (std::size_t i = 0; i < seen.size(); ++i) {
    const TileHead& a = *seen[i];
    gradient_weight(a, work.rays, work.weight);
    add_gradient(a, work.weight, count(&a), sums.gradient.data() + a.head * K);
    for (std::size_t j = i; j < seen.size(); ++j) {
      const TileHead& b = *seen[j];
      pair_weight(a, b, i == j, work.rays, work.weight);
      add_block(a.J, count(&a), b.J, count(&b), work.weight, K, sums.block(a.head, b.head));
      if (i == j) add_block(a.J, count(&a), a.J_others, count(&a), work.weight, K, sums.common_block(a.head));
    }
  }
}

}  // namespace

Normal::Normal(int head_count, int slot_count)
    : heads(head_count),
      slots(slot_count),
      gradient(static_cast<std::size_t>(head_count * slot_count)),
      blocks(static_cast<std::size_t>(pair_count(head_count) * slot_count * slot_count)),
      common(static_cast<std::size_t>(head_count * slot_count * slot_count)),
      pairs(static_cast<std::size_t>(pair_count(head_count))),
      shared(static_cast<std::size_t>(head_count)) {}

double Normal::objective() const { return measure > 0 ? cost / measure : std::numeric_limits<double>::infinity(); }

double* Normal::block(int a, int b) { return blocks.data() + static_cast<int>(pair(a, b)) * slots * slots; }

double* Normal::common_block(int head) { return common.data() + head * slots * slots; }

Eigen::MatrixXd Normal::hessian(int a, int b, Curvature curvature) const {
  using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
  if (a == b && curvature == Curvature::kCommon) {
    const Eigen::Map<const RowMajor> stored(common.data() + a * slots * slots, slots, slots);
    return 0.5 * (stored + stored.transpose());
  }
  const Eigen::Map<const RowMajor> stored(
      blocks.data() + static_cast<int>(pair(std::min(a, b), std::max(a, b))) * slots * slots, slots, slots);
  if (a <= b) return stored;
  return stored.transpose();
}

void Normal::add(const Normal& other) {
  cost += other.cost;
  measure += other.measure;
  for (std::size_t k = 0; k < gradient.size(); ++k) gradient[k] += other.gradient[k];
  for (std::size_t k = 0; k < blocks.size(); ++k) blocks[k] += other.blocks[k];
  for (std::size_t k = 0; k < common.size(); ++k) common[k] += other.common[k];
  for (std::size_t k = 0; k < pairs.size(); ++k) pairs[k].add(other.pairs[k]);
  for (std::size_t k = 0; k < shared.size(); ++k) shared[k] += other.shared[k];
}

Objective::Objective(const std::vector<Tile>& tiles, std::vector<std::vector<PlaneRef>> planes, double level_scale,
                     double margin_px, ObjectiveSettings settings, const parallel::Workers& workers)
    : planes_(std::move(planes)),
      level_scale_(level_scale),
      margin_px_(margin_px),
      settings_(settings),
      workers_(workers),
      used_(planes_.size(), true),
      tables_(planes_.size()) {
  tiles_.reserve(tiles.size());
  for (const Tile& tile : tiles) tiles_.push_back(&tile);
  for (std::size_t p = 0; p < planes_.front().size(); ++p) {
    channels_.push_back(static_cast<int>(p) % settings_.channels);
  }
}

Status Objective::tabulate(const HeadState& head, bool derivatives, KeptTable& kept) const {
  NODAL_TRY_ASSIGN(const double angle, head.used_angle());
  if (kept.angle == angle && kept.lens == head.lens && (kept.derivatives || !derivatives)) return {};
  NODAL_TRY_ASSIGN(RadialTable table,
                   RadialTable::make(head.lens, angle, head.edge_angle, head.edge_radius, derivatives));
  kept = {head.lens, angle, derivatives, std::move(table)};
  return {};
}

Result<Objective::Sights> Objective::sights_of(const std::vector<HeadState>& heads, const Sought& sought,
                                               bool derivatives) {
  std::vector<Status> made(heads.size());
  workers_.run(static_cast<int>(heads.size()), [&](int h) {
    const auto i = static_cast<std::size_t>(h);
    made[i] = tabulate(heads[i], derivatives && (sought.focal || sought.lens), tables_[i]);
  });
  for (const Status& each : made) {
    if (!each) return fail(each.error());
  }
  Sights sights;
  for (std::size_t h = 0; h < heads.size(); ++h) {
    const KeptTable& kept = tables_[h];
    sights.heads.push_back(sight_of(heads[h], kept.table, kept.angle, planes_[h], level_scale_, margin_px_));
    sights.heads.back().channels = channels_;
    sights.slots.push_back(slots_of(sought, radial_count(heads[h].lens)));
    sights.stride = std::max(sights.stride, sights.slots.back().count);
  }
  return sights;
}

Result<Normal> Objective::evaluate(const std::vector<HeadState>& heads, const Sought& sought, bool derivatives) {
  NODAL_TRY_ASSIGN(const Sights sights, sights_of(heads, sought, derivatives));
  const int chunks = chunk_count(tiles_.size());
  std::vector<Normal> sums(static_cast<std::size_t>(chunks), Normal(static_cast<int>(heads.size()), sights.stride));
  const std::span<const Tile* const> tiles(tiles_);
  workers_.run(chunks, [&](int c) {
    const auto i = static_cast<std::size_t>(c), n = static_cast<std::size_t>(chunks);
    const std::size_t first = tiles.size() * i / n, last = tiles.size() * (i + 1) / n;
    sum_tiles(sights, tiles.subspan(first, last - first), derivatives, sums[i]);
  });
  for (std::size_t c = 1; c < sums.size(); ++c) sums[0].add(sums[c]);
  return std::move(sums[0]);
}

std::size_t coarse_part(std::size_t part) { return part / 16 * 4 + part % 16 / 8 * 2 + part % 4 / 2; }

Result<std::vector<Normal>> Objective::evaluate_parts(const std::vector<HeadState>& heads, const Sought& sought) {
  NODAL_TRY_ASSIGN(const Sights sights, sights_of(heads, sought, true));
  std::vector<std::vector<const Tile*>> tiles(kParts);
  for (const Tile* tile : tiles_) tiles[part_of(*tile)].push_back(tile);
  std::vector<Normal> parts(kParts, Normal(static_cast<int>(heads.size()), sights.stride));
  workers_.run(kParts, [&](int p) {
    const auto i = static_cast<std::size_t>(p);
    sum_tiles(sights, tiles[i], true, parts[i]);
  });
  return parts;
}

void Objective::sum_tiles(const Sights& all, std::span<const Tile* const> tiles, bool derivatives, Normal& sums) const {
  const std::vector<HeadSight>& sights = all.heads;
  Workspace work;
  work.heads.resize(sights.size());
  std::vector<TileHead*> seen;
  std::vector<std::size_t> near;
  const std::size_t planes = sights.front().planes.size();
  for (const Tile* const next : tiles) {
    const Tile& tile = *next;
    near.clear();
    for (std::size_t h = 0; h < sights.size(); ++h) {
      if (used_[h] && may_see(sights[h], tile)) near.push_back(h);
    }
    if (near.size() < 2) continue;
    seen.clear();
    for (const std::size_t h : near) {
      TileHead& head = work.heads[seen.size()];
      head.head = static_cast<int>(h);
      if (project(sights[h], tile, head)) seen.push_back(&head);
    }
    if (seen.size() < 2) continue;
    for (std::size_t p = 0; p < planes; ++p) {
      for (TileHead* head : seen) sample(sights[static_cast<std::size_t>(head->head)], static_cast<int>(p), *head);
      if (!compare(seen.data(), static_cast<int>(seen.size()), tile, settings_.huber, settings_.max_norm, work.rays)) {
        break;
      }
      add_cost(work.rays, &sums.cost, &sums.measure);
      for (std::size_t a = 0; a < seen.size(); ++a) {
        sums.shared[static_cast<std::size_t>(seen[a]->head)] += shared_solid_angle(*seen[a], work.rays);
        for (std::size_t b = a + 1; b < seen.size(); ++b) {
          add_pair(*seen[a], *seen[b], work.rays, sums.pairs[sums.pair(seen[a]->head, seen[b]->head)]);
        }
      }
      if (derivatives) {
        add_derivatives(seen, sights, all.slots, sights.front().channels[p], work, sums);
      }
    }
  }
}

std::vector<Cone> cones_of(const std::vector<HeadState>& heads, double slack) {
  std::vector<Cone> cones;
  for (const HeadState& head : heads) {
    const Eigen::Vector3d axis = head.q_head_rig.conjugate() * Eigen::Vector3d::UnitZ();
    cones.push_back({axis, head.used_angle().value_or(std::numbers::pi) + head.parallax() + slack});
  }
  return cones;
}

bool shared_tile(const Tile& tile, const std::vector<Cone>& cones) {
  int seers = 0;
  const double radius = std::acos(std::clamp(static_cast<double>(tile.cos_radius), -1.0, 1.0));
  const Eigen::Vector3d axis = Eigen::Vector3f(tile.axis[0], tile.axis[1], tile.axis[2]).cast<double>();
  for (const Cone& cone : cones) {
    if (std::acos(std::clamp(cone.axis.dot(axis), -1.0, 1.0)) <= cone.reach + radius) ++seers;
  }
  return seers >= 2;
}

}  // namespace nodal::registration
