#include "stitch/registration/search.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <optional>

#include "protocol/base/angles.h"
#include "protocol/base/try.h"
#include "stitch/geometry/lens/lens.h"
#include "stitch/registration/head_sight.h"

namespace nodal::registration {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

constexpr double kPixelDeg = 1.2;  // approximate angle of a pixel in the pictures that are compared
constexpr double kGridDeg = 3.0;   // step of the search: detail blurred by two such pixels still correlates over it
constexpr int kStride = 2;         // every second blurred pixel is used, in both directions
constexpr std::size_t kCandidates = 6;
constexpr double kMinRays = 40;
constexpr int kRounds = 6;
constexpr std::size_t kFewNeighbours = 2;  // more neighbours leave a head no other place
constexpr std::size_t kGlance = 4;         // the first, rough evaluation uses one tile in this many
constexpr double kOtherDeg = 7.5;          // turns that are closer are the same maximum
constexpr std::size_t kLookedAt = 12;      // then the best turns, one in this many, are evaluated completely

// One head's blurred detail, as rays in its own frame and as a picture to sample.
struct Sample {
  Plane plane;
  RadialTable table;
  double angle = 0, scale = 1;
  std::vector<Tile> rays;
  std::vector<std::vector<float>> values;  // values at the rays of each tile
};

struct Candidate {
  Matrix3d R_b_a;
  double score = 0;
};

struct Pair {
  std::size_t a = 0, b = 0;
  std::vector<Candidate> candidates;
};

int search_level(const HeadPyramid& pyramid, double per_radian) {
  const double level = std::log2(kPixelDeg * kRadiansPerDegree * per_radian);
  return std::clamp(static_cast<int>(std::lround(level)), 0, static_cast<int>(pyramid.levels.size()) - 1);
}

// The ray of a pixel in the head's own frame, if it is inside the region and the lens.
std::optional<Vector3d> own_ray(const HeadState& head, const geometry::Lens& lens, double u, double v) {
  const Region& region = head.region;
  if (u < region.left || u > region.right || v < region.top || v > region.bottom) return std::nullopt;
  if (region.circle && std::hypot(u - region.circle->x, v - region.circle->y) > region.circle->radius) {
    return std::nullopt;
  }
  if (head.masks && head.masks->hides(static_cast<float>(u), static_cast<float>(v), 0)) return std::nullopt;
  const double x = u - head.center_x, y = (v - head.center_y) / head.aspect, r = std::hypot(x, y);
  const std::optional<double> angle = lens.angle(r);
  if (!angle) return std::nullopt;
  const double s = r > 0 ? std::sin(*angle) / r : 0;
  return Vector3d(s * x, s * y, std::cos(*angle));
}

void add_rays(const HeadState& head, const geometry::Lens& lens, Sample& sample) {
  int held = kTile;
  for (int j = 0; j < sample.plane.height; j += kStride) {
    for (int i = 0; i < sample.plane.width; i += kStride) {
      const std::optional<Vector3d> ray = own_ray(head, lens, (i + 0.5) * sample.scale, (j + 0.5) * sample.scale);
      if (!ray) continue;
      if (held == kTile) {
        sample.rays.emplace_back();
        sample.values.emplace_back(static_cast<std::size_t>(kTile));
        held = 0;
      }
      Tile& tile = sample.rays.back();
      tile.x[held] = static_cast<float>(ray->x());
      tile.y[held] = static_cast<float>(ray->y());
      tile.z[held] = static_cast<float>(ray->z());
      tile.omega[held] = 1;
      sample.values.back()[static_cast<std::size_t>(held)] =
          sample.plane.values[static_cast<std::size_t>(j * sample.plane.width + i)];
      ++held;
    }
  }
}

Result<Sample> make_sample(const HeadPyramid& pyramid, const HeadState& head, double per_radian) {
  Sample sample;
  const int level = search_level(pyramid, per_radian);
  sample.scale = 1 << level;
  const Result<geometry::Lens> lens = geometry::Lens::make(head.lens, head.max_angle);
  const Result<double> angle = head.used_angle();
  if (!lens || !angle) return fail(lens ? angle.error() : lens.error());
  sample.angle = *angle;
  NODAL_TRY_ASSIGN(RadialTable table, RadialTable::make(head.lens, *angle, head.edge_angle, head.edge_radius, false));
  sample.table = std::move(table);
  const double pixel = sample.scale / per_radian;
  const Plane& light = pyramid.levels[static_cast<std::size_t>(level)].front();
  sample.plane = blurred_in_angle(light, level, head, 2 * pixel);
  const Plane wide = blurred_in_angle(light, level, head, 8 * pixel);
  for (std::size_t k = 0; k < wide.values.size(); ++k) sample.plane.values[k] -= wide.values[k];
  add_rays(head, *lens, sample);
  return sample;
}

// The correlation of one head's rays with another head's picture, for one turn.
class Correlator {
 public:
  Correlator(const Sample& from, const HeadState& into, const Sample& picture)
      : from_(from),
        sight_(sight_of(into, picture.table, picture.angle, {picture.plane.ref()}, picture.scale, 0)),
        seen_(std::make_unique<TileHead>()) {
    sight_.channels = {0};
    sight_.nearness = 0;  // the rays are another head's, not the rig's
    for (float& gain : sight_.gain) gain = 1;
    for (float& term : sight_.vignetting) term = 0;
  }

  // The significance, -n log(1 - correlation^2): a large overlap outweighs a small one that correlates by chance.
  // `step`: uses only every step-th tile.
  double score(const Matrix3d& R_into_from, std::size_t step = 1) {
    for (int k = 0; k < 9; ++k) sight_.R[k] = static_cast<float>(R_into_from(k / 3, k % 3));
    double n = 0, a = 0, b = 0, aa = 0, ab = 0, bb = 0;
    for (std::size_t t = 0; t < from_.rays.size(); t += step) {
      if (!project(sight_, from_.rays[t], *seen_)) continue;
      sample(sight_, 0, *seen_);
      const std::vector<float>& values = from_.values[t];
      for (std::size_t i = 0; i < static_cast<std::size_t>(kTile); ++i) {
        if (!(seen_->weight[i] > 0) || from_.rays[t].omega[i] <= 0) continue;
        const auto va = static_cast<double>(values[i]), vb = static_cast<double>(seen_->light[i]);
        n += 1;
        a += va;
        b += vb;
        aa += va * va;
        ab += va * vb;
        bb += vb * vb;
      }
    }
    if (n * static_cast<double>(step) < kMinRays) return 0;
    const double variance = (aa - a * a / n) * (bb - b * b / n), covariance = ab - a * b / n;
    if (variance <= 0 || covariance <= 0) return 0;
    return -n * std::log(1 - std::min(0.9999, covariance * covariance / variance));
  }

 private:
  const Sample& from_;
  HeadSight sight_;
  std::unique_ptr<TileHead> seen_;
};

std::vector<Vector3d> grid_of_turns() {
  std::vector<Vector3d> turns;
  const int reach = static_cast<int>(kSearchedDeg / kGridDeg);
  for (int i = -reach; i <= reach; ++i) {
    for (int j = -reach; j <= reach; ++j) {
      for (int k = -reach; k <= reach; ++k) {
        const Vector3d turn = Vector3d(i, j, k) * kGridDeg;
        if (turn.norm() <= kSearchedDeg) turns.push_back(turn * kRadiansPerDegree);
      }
    }
  }
  return turns;
}

double apart(const Matrix3d& A, const Matrix3d& B) { return Eigen::AngleAxisd(A * B.transpose()).angle(); }

Matrix3d turn_by(const Vector3d& w) {
  const double angle = w.norm();
  return angle > 0 ? Eigen::AngleAxisd(angle, w / angle).toRotationMatrix() : Matrix3d::Identity();
}

// Refines a maximum on the grid with decreasing steps.
Candidate climb(Correlator& correlator, Candidate best) {
  for (double step = kGridDeg / 2; step > kGridDeg / 10; step /= 2) {
    for (bool better = true; better;) {
      better = false;
      for (int k = 0; k < 6; ++k) {
        const Vector3d w = Vector3d::Unit(k / 2) * (k % 2 == 0 ? step : -step) * kRadiansPerDegree;
        const Matrix3d R = turn_by(w) * best.R_b_a;
        const double score = correlator.score(R);
        if (score <= best.score) continue;
        best = {R, score};
        better = true;
      }
    }
  }
  return best;
}

std::vector<Candidate> candidates_of(Correlator correlator, const Matrix3d& prior_b_a,
                                     const std::vector<Vector3d>& turns) {
  std::vector<Candidate> all;
  for (const Vector3d& turn : turns) {
    const Matrix3d R = turn_by(turn) * prior_b_a;
    if (const double score = correlator.score(R, kGlance); score > 0) all.push_back({R, score});
  }
  // A rough evaluation selects the few turns that are evaluated completely.
  std::ranges::stable_sort(all, std::greater<>(), &Candidate::score);
  all.resize(std::min(all.size(), turns.size() / kLookedAt));
  for (Candidate& each : all) each.score = correlator.score(each.R_b_a);
  std::ranges::stable_sort(all, std::greater<>(), &Candidate::score);
  std::vector<Candidate> kept;
  for (const Candidate& each : all) {
    const auto near = [&](const Candidate& other) {
      return apart(each.R_b_a, other.R_b_a) < kOtherDeg * kRadiansPerDegree;
    };
    if (std::ranges::any_of(kept, near)) continue;
    kept.push_back(each);
    if (kept.size() == kCandidates) break;
  }
  for (Candidate& each : kept) each = climb(correlator, each);
  return kept;
}

// Combines the candidates of all pairs into one rotation per head.
class Assembly {
 public:
  Assembly(const std::vector<HeadState>& heads, const std::vector<Sample>& samples, std::vector<Pair> pairs)
      : heads_(heads), samples_(samples), pairs_(std::move(pairs)), R_(heads.size()) {
    for (std::size_t h = 0; h < heads.size(); ++h) R_[h] = heads[h].q_head_rig.toRotationMatrix();
  }

  std::vector<HeadState> assemble(std::size_t first) {
    grow(first);
    for (int round = 0; round < kRounds && improve(first); ++round) {}
    std::vector<HeadState> placed = heads_;
    for (std::size_t h = 0; h < placed.size(); ++h) placed[h].q_head_rig = Eigen::Quaterniond(R_[h]).normalized();
    return placed;
  }

  std::vector<Rival> rivals(std::size_t head) const {
    std::vector<Rival> rivals;
    const double held = support(head, R_[head]);
    if (held <= 0) return rivals;
    for (const Pair& pair : pairs_) {
      if (pair.a != head && pair.b != head) continue;
      for (const Candidate& each : pair.candidates) {
        const Matrix3d R = turned_by(pair, each, head);
        const double turned = apart(R, R_[head]);
        if (turned < kOtherDeg * kRadiansPerDegree) continue;
        rivals.push_back({head, Eigen::Quaterniond(R).normalized(), turned, support(head, R) / held});
      }
    }
    return rivals;
  }

 private:
  // The rotation that a pair's candidate gives one of its heads.
  Matrix3d turned_by(const Pair& pair, const Candidate& candidate, std::size_t head) const {
    return pair.a == head ? Matrix3d(candidate.R_b_a.transpose() * R_[pair.b]) : Matrix3d(candidate.R_b_a * R_[pair.a]);
  }

  // Places heads in the order of the significance of their best candidate against the heads placed already.
  void grow(std::size_t first) {
    std::vector<bool> placed(heads_.size(), false);
    placed[first] = true;
    for (;;) {
      const Candidate* best = nullptr;
      std::size_t head = 0;
      Matrix3d R;
      for (const Pair& pair : pairs_) {
        if (placed[pair.a] == placed[pair.b] || pair.candidates.empty()) continue;
        const Candidate& top = pair.candidates.front();
        if (best != nullptr && top.score <= best->score) continue;
        best = &top;
        head = placed[pair.a] ? pair.b : pair.a;
        R = turned_by(pair, top, head);
      }
      if (best == nullptr) return;
      R_[head] = R;
      placed[head] = true;
    }
  }

  double support(std::size_t head, const Matrix3d& R) const {
    double sum = 0;
    for (const Pair& pair : pairs_) {
      if (pair.a != head && pair.b != head) continue;
      const Matrix3d relative =
          pair.a == head ? Matrix3d(R_[pair.b] * R.transpose()) : Matrix3d(R * R_[pair.a].transpose());
      sum += Correlator(samples_[pair.a], heads_[pair.b], samples_[pair.b]).score(relative);
    }
    return sum;
  }

  // Moves every head to the rotation that most of its neighbours' candidates support. False if none moved.
  bool improve(std::size_t first) {
    bool moved = false;
    for (std::size_t head = 0; head < heads_.size(); ++head) {
      if (head == first) continue;
      double best = support(head, R_[head]);
      Matrix3d where = R_[head];
      for (const Pair& pair : pairs_) {
        if (pair.a != head && pair.b != head) continue;
        for (const Candidate& each : pair.candidates) {
          const Matrix3d R = turned_by(pair, each, head);
          const double score = support(head, R);
          if (score <= best * 1.001) continue;
          best = score;
          where = R;
        }
      }
      moved = moved || where != R_[head];
      R_[head] = where;
    }
    return moved;
  }

  const std::vector<HeadState>& heads_;
  const std::vector<Sample>& samples_;
  std::vector<Pair> pairs_;
  std::vector<Matrix3d> R_;
};

std::vector<Pair> possible_pairs(const std::vector<HeadState>& heads, const std::vector<bool>& used) {
  // Half of the searched angle: heads farther apart would share too little to be found.
  const std::vector<Cone> cones = cones_of(heads, 0);
  std::vector<Pair> pairs;
  for (std::size_t a = 0; a < heads.size(); ++a) {
    for (std::size_t b = a + 1; b < heads.size(); ++b) {
      if (!used[a] || !used[b]) continue;
      const double between = std::acos(std::clamp(cones[a].axis.dot(cones[b].axis), -1.0, 1.0));
      if (between < cones[a].reach + cones[b].reach) pairs.push_back({a, b, {}});
    }
  }
  return pairs;
}

// The heads' samples, and the best turns of all pairs.
struct Compared {
  std::vector<Sample> samples;
  std::vector<Pair> pairs;
};

Result<Compared> compare(const std::vector<HeadPyramid>& pyramids, const std::vector<HeadState>& heads,
                         std::vector<Pair> pairs, const parallel::Workers& workers) {
  const double per_radian = pixels_per_radian(heads);
  Compared compared;
  compared.pairs = std::move(pairs);
  for (std::size_t h = 0; h < heads.size(); ++h) {
    NODAL_TRY_ASSIGN(Sample sample, make_sample(pyramids[h], heads[h], per_radian));
    compared.samples.push_back(std::move(sample));
  }
  const std::vector<Vector3d> turns = grid_of_turns();
  workers.run(static_cast<int>(compared.pairs.size()), [&](int p) {
    Pair& pair = compared.pairs[static_cast<std::size_t>(p)];
    const Matrix3d prior =
        heads[pair.b].q_head_rig.toRotationMatrix() * heads[pair.a].q_head_rig.toRotationMatrix().transpose();
    pair.candidates =
        candidates_of(Correlator(compared.samples[pair.a], heads[pair.b], compared.samples[pair.b]), prior, turns);
  });
  return compared;
}

}  // namespace

Result<std::vector<HeadState>> search_rotations(const std::vector<HeadPyramid>& pyramids,
                                                const std::vector<HeadState>& heads, const std::vector<bool>& used,
                                                const parallel::Workers& workers) {
  NODAL_TRY_ASSIGN(Compared compared, compare(pyramids, heads, possible_pairs(heads, used), workers));
  const auto first = static_cast<std::size_t>(std::ranges::find(used, true) - used.begin());
  return Assembly(heads, compared.samples, std::move(compared.pairs)).assemble(std::min(first, heads.size() - 1));
}

Result<std::vector<Rival>> rival_rotations(const std::vector<HeadPyramid>& pyramids,
                                           const std::vector<HeadState>& heads, const std::vector<bool>& used,
                                           const parallel::Workers& workers) {
  std::vector<Pair> pairs = possible_pairs(heads, used);
  std::vector<std::size_t> neighbours(heads.size());
  for (const Pair& pair : pairs) ++neighbours[pair.a], ++neighbours[pair.b];
  const auto alone = [&](std::size_t head) { return used[head] && neighbours[head] <= kFewNeighbours; };
  std::erase_if(pairs, [&](const Pair& pair) { return !alone(pair.a) && !alone(pair.b); });
  if (pairs.empty()) return std::vector<Rival>();
  NODAL_TRY_ASSIGN(Compared compared, compare(pyramids, heads, std::move(pairs), workers));
  const Assembly assembly(heads, compared.samples, std::move(compared.pairs));
  std::vector<std::vector<Rival>> of_head(heads.size());
  workers.run(static_cast<int>(heads.size()), [&](int h) {
    const auto head = static_cast<std::size_t>(h);
    if (alone(head)) of_head[head] = assembly.rivals(head);
  });
  std::vector<Rival> rivals;
  for (const std::vector<Rival>& ones : of_head) rivals.insert(rivals.end(), ones.begin(), ones.end());
  std::ranges::stable_sort(rivals, std::greater<>(), &Rival::support);
  return rivals;
}

}  // namespace nodal::registration
