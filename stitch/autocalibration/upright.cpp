#include "stitch/autocalibration/upright.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>

#include "protocol/base/angles.h"
#include "stitch/autocalibration/stance.h"

namespace nodal::autocalibration {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

constexpr double kMinSlope = 3;   // levels per pixel, for an edge
constexpr int kStraight = 6;      // px; an edge is straight if its direction is the same this far along it,
constexpr double kAlike = 0.985;  // to this cosine
constexpr double kUprightTolerance = 1.5 * kRadiansPerDegree;  // start tolerance of the search
constexpr double kFinest = 0.3 * kRadiansPerDegree;            // final tolerance of the search
// Search radius around the light's direction, and around up as pictures are held.
constexpr double kWindow = 35 * kRadiansPerDegree;
// Search radius around the light's direction for edges that are beyond doubt.
constexpr double kWideWindow = 60 * kRadiansPerDegree;
constexpr double kWideStep = 2 * kRadiansPerDegree;
// Farther from how pictures are held, edges must be beyond doubt; few people tilt a camera so far.
constexpr double kOtherWay = 45 * kRadiansPerDegree;
constexpr double kRingWindow = 12 * kRadiansPerDegree;  // search radius around a ring's axis
constexpr double kRim = 0.06;  // share of an image circle's radius; edges in this rim are not used
constexpr std::size_t kSectors = 12;
// Sectors in which a horizon may be hidden: few where a ring of heads, whose axis is as good a guess, looks all around.
constexpr std::size_t kHidden = kSectors / 2, kHiddenFromRing = 1;
constexpr double kHorizonWeight = 3;  // a horizon all around is rarely seen by chance, straight things more often
constexpr double kStep = 1 * kRadiansPerDegree;
constexpr double kSure = 150;          // standard deviations; textures and patterns reach 130
constexpr double kBeyondDoubt = 1000;  // a horizon at sea has some thousands
// Share of the seen sectors that need such edges; lines on the ground fill up to half, see below.
constexpr double kAllAround = 2.0 / 3;
constexpr double kOften = 3;  // a sector needs so many times the edges expected by chance,
constexpr double kFew = 8;    // plus so many
constexpr std::size_t kMaxEdges = 40000;

struct Lit {
  float level = 0;
  double solid_angle = 0;
  Vector3d direction;
};

struct Edge {
  Vector3d ray;
  Vector3d normal;  // normal of the plane through the edge and O
};

struct Seen {
  std::vector<Edge> edges;
  std::vector<Lit> lit;
};

// Blurred by the binomial 1 4 6 4 1 both ways: the directions of edges are more exact.
Picture blurred(const Picture& picture) {
  constexpr std::array<float, 5> kWeights{1.0F / 16, 4.0F / 16, 6.0F / 16, 4.0F / 16, 1.0F / 16};
  const auto along = [&](const Picture& from, bool rows) {
    Picture to = from;
    for (int y = 0; y < from.height; ++y) {
      for (int x = 0; x < from.width; ++x) {
        float sum = 0;
        for (int k = -2; k <= 2; ++k) {
          const int i = std::clamp(rows ? x + k : x, 0, from.width - 1),
                    j = std::clamp(rows ? y : y + k, 0, from.height - 1);
          sum += kWeights[static_cast<std::size_t>(k + 2)] * from.at(i, j);
        }
        to.values[static_cast<std::size_t>(y) * static_cast<std::size_t>(to.width) + static_cast<std::size_t>(x)] = sum;
      }
    }
    return to;
  };
  return along(along(picture, true), false);
}

// Adds a picture's edges, and its light by solid angle.
void add_picture(const geometry::Head& head, const Picture& sharp, Seen& seen) {
  const Picture picture = blurred(sharp);
  const double scale = static_cast<double>(head.width()) / picture.width;
  // An image circle's edge is dark by itself.
  const auto& circle = head.calibration().region.circle;
  const double margin = circle ? kRim * circle->radius : 4 * scale;
  const auto slope_at = [&](int x, int y) {
    return Eigen::Vector2d(double{picture.at(x + 1, y) - picture.at(x - 1, y)} / 2,
                           double{picture.at(x, y + 1) - picture.at(x, y - 1)} / 2);
  };
  constexpr int kBorder = kStraight + 3;
  for (int y = kBorder; y + kBorder < picture.height; ++y) {
    for (int x = kBorder; x + kBorder < picture.width; ++x) {
      const geometry::Pixel at{(x + 0.5) * scale, (y + 0.5) * scale};
      const bool lit = x % 4 == 0 && y % 4 == 0;
      const Eigen::Vector2d slope = slope_at(x, y);
      const bool steep = slope.norm() >= kMinSlope;
      if ((!lit && !steep) || head.distance_to_edge(at) < margin) continue;
      const auto ray = head.unproject(at);
      if (!ray) continue;
      if (lit) {
        const double density = head.density(at);
        if (density > 0) seen.lit.push_back({picture.at(x, y), 1 / density, ray->direction()});
      }
      if (!steep) continue;
      // Only straight edges count: farther along, the slope is the same.
      const Eigen::Vector2d along(-slope.y() / slope.norm(), slope.x() / slope.norm());
      Eigen::Vector2d sum = slope;
      bool straight = true;
      for (const int step : {-kStraight, kStraight}) {
        // Between pixels, the slope is interpolated: without that, edges along rows and diagonals would be preferred.
        const double px = x + step * along.x(), py = y + step * along.y();
        const int ix = static_cast<int>(std::floor(px)), iy = static_cast<int>(std::floor(py));
        const double fx = px - ix, fy = py - iy;
        const Eigen::Vector2d farther = (1 - fy) * ((1 - fx) * slope_at(ix, iy) + fx * slope_at(ix + 1, iy)) +
                                        fy * ((1 - fx) * slope_at(ix, iy + 1) + fx * slope_at(ix + 1, iy + 1));
        straight = straight && farther.dot(slope) > kAlike * farther.norm() * slope.norm() &&
                   farther.norm() > slope.norm() / 2;
        sum += farther;
      }
      if (!straight) continue;
      sum.normalize();
      const auto beside = head.unproject({at.x - sum.y() * 2 * scale, at.y + sum.x() * 2 * scale});
      if (!beside) continue;
      const Vector3d normal = ray->direction().cross(beside->direction());
      if (normal.norm() > 0) seen.edges.push_back({ray->direction(), normal.normalized()});
    }
  }
}

// The mean direction of the brighter half of what is seen. The sun's own brightness does not count.
Vector3d light_of(std::vector<Lit> lit) {
  std::ranges::stable_sort(lit, [](const Lit& a, const Lit& b) { return a.level < b.level; });
  double whole = 0, before = 0;
  for (const Lit& one : lit) whole += one.solid_angle;
  Vector3d light = Vector3d::Zero();
  for (std::size_t i = 0; i < lit.size();) {
    // Equal levels have one rank.
    double own = 0;
    Vector3d sum = Vector3d::Zero();
    std::size_t k = i;
    for (; k < lit.size() && lit[k].level == lit[i].level; ++k) {
      own += lit[k].solid_angle;
      sum += lit[k].solid_angle * lit[k].direction;
    }
    light += ((before + own / 2) / whole - 0.5) * sum;
    before += own;
    i = k;
  }
  return light;
}

// How many edges are vertical or lie on the horizon, in standard deviations above what chance gives. A horizon is
// seen in all sectors but `hidden`: a single straight edge is none, and shelves, paths and lawns end in some.
double agreement(const std::vector<Edge>& edges, const Vector3d& up, double tolerance, std::size_t hidden) {
  const double near = std::sin(tolerance), along = std::cos(2 * tolerance);  // hills hide the true horizon
  const Vector3d side = up.unitOrthogonal(), other = up.cross(side);
  std::size_t vertical = 0;
  std::array<std::size_t, kSectors> horizon{};
  for (const Edge& edge : edges) {
    const double c = std::abs(edge.normal.dot(up));
    if (c < near) ++vertical;
    if (c <= along) continue;
    const double turn = std::atan2(edge.ray.dot(side), edge.ray.dot(other)) / (2 * std::numbers::pi) + 0.5;
    ++horizon[std::min(kSectors - 1, static_cast<std::size_t>(turn * kSectors))];
  }
  std::ranges::nth_element(horizon, horizon.begin() + static_cast<std::ptrdiff_t>(hidden));
  const std::size_t all_around = kSectors * horizon[hidden];
  const auto n = static_cast<double>(edges.size());
  const auto beyond = [n](std::size_t count, double chance) {
    return std::max(0.0, (static_cast<double>(count) - n * chance) / std::sqrt(n * chance));
  };
  return beyond(vertical, near) + kHorizonWeight * beyond(all_around, 1 - along);
}

// Whether the edges that agree on `up` are in most directions around it, of those that the heads see. Parallel lines on
// the ground all agree on a wrong `up`, their own direction; but about that direction they are on one side, where the
// ground is. A single long straight edge, which agrees on a wrong horizon, is on one side, too.
bool all_around(const std::vector<Edge>& edges, const std::vector<geometry::Head>& heads, const Vector3d& up) {
  const double near = std::sin(kUprightTolerance), along = std::cos(2 * kUprightTolerance);
  const Vector3d side = up.unitOrthogonal(), other = up.cross(side);
  std::array<double, kSectors> all{}, vertical{}, horizon{};
  for (const Edge& edge : edges) {
    const double turn = std::atan2(edge.ray.dot(side), edge.ray.dot(other)) / (2 * std::numbers::pi) + 0.5;
    const std::size_t sector = std::min(kSectors - 1, static_cast<std::size_t>(turn * kSectors));
    const double c = std::abs(edge.normal.dot(up));
    ++all[sector];
    if (c < near) ++vertical[sector];
    if (c > along) ++horizon[sector];
  }
  std::size_t seen = 0, with_vertical = 0, with_horizon = 0;
  for (std::size_t s = 0; s < kSectors; ++s) {
    const double turn = (2 * (static_cast<double>(s) + 0.5) / kSectors - 1) * std::numbers::pi;
    const Vector3d level = std::sin(turn) * side + std::cos(turn) * other;
    const bool is_seen = std::ranges::any_of(heads, [&](const geometry::Head& head) {
      return head.pixel_of(geometry::Ray::towards(level.x(), level.y(), level.z())).has_value();
    });
    if (is_seen) ++seen;
    if (vertical[s] > kFew + kOften * near * all[s]) ++with_vertical;
    if (horizon[s] > kFew + kOften * (1 - along) * all[s]) ++with_horizon;
  }
  return static_cast<double>(std::max(with_vertical, with_horizon)) >= kAllAround * static_cast<double>(seen);
}

// The best direction within `window` of `start`, on which at least `least` agree.
void search_around(const std::vector<Edge>& edges, const Vector3d& start, double window, double step,
                   std::size_t hidden, Upright& found, double& best) {
  const Vector3d side = start.unitOrthogonal(), other = start.cross(side);
  const int steps = static_cast<int>(window / step);
  for (int i = -steps; i <= steps; ++i) {
    for (int j = -steps; j <= steps; ++j) {
      if (i * i + j * j > steps * steps) continue;
      const Vector3d up = (start + std::tan(i * step) * side + std::tan(j * step) * other).normalized();
      const double score = agreement(edges, up, kUprightTolerance, hidden);
      if (score <= best) continue;
      best = score;
      found.up = up;
    }
  }
}

// A regular subset: the same one in every run.
void thin_out(std::vector<Edge>& edges) {
  if (edges.size() <= kMaxEdges) return;
  const std::size_t step = edges.size() / kMaxEdges + 1;
  for (std::size_t i = 0; i * step < edges.size(); ++i) edges[i] = edges[i * step];
  edges.resize((edges.size() + step - 1) / step);
}

void refine(const std::vector<Edge>& edges, std::size_t hidden, Upright& found) {
  const Vector3d side = found.up.unitOrthogonal(), other = found.up.cross(side);
  for (double step = kStep / 2; step > kStep / 16; step /= 2) {
    const Vector3d middle = found.up;
    double best = 0;
    for (int i = -2; i <= 2; ++i) {
      for (int j = -2; j <= 2; ++j) {
        const Vector3d up = (middle + i * step * side + j * step * other).normalized();
        const double score = agreement(edges, up, std::max(kFinest, step), hidden);
        if (score <= best) continue;
        best = score;
        found.up = up;
      }
    }
  }
}

std::vector<HeldHead> stance_of(const std::vector<geometry::Head>& heads, const std::vector<Eigen::Vector2d>& held) {
  std::vector<HeldHead> all;
  for (std::size_t h = 0; h < heads.size(); ++h) {
    const Eigen::Vector2d up = h < held.size() ? held[h] : Eigen::Vector2d(0, -1);
    const Matrix3d R = heads[h].R_head_rig();
    all.push_back({R.row(2).transpose(), (up.x() * R.row(0) + up.y() * R.row(1)).transpose()});
  }
  return all;
}

}  // namespace

Upright find_upright(const std::vector<geometry::Head>& heads, const std::vector<Picture>& pictures,
                     const std::vector<Eigen::Vector2d>& held) {
  Seen seen;
  for (std::size_t h = 0; h < heads.size(); ++h) add_picture(heads[h], pictures[h], seen);
  thin_out(seen.edges);
  Upright found;
  if (const Vector3d light = light_of(std::move(seen.lit)); light.norm() > 1e-9) found.up = light.normalized();
  const Vector3d light = found.up;
  const std::vector<HeldHead> stance = stance_of(heads, held);
  const std::optional<Vector3d> ring = ring_up(stance, light), upright = held_up(stance);
  double best = 0;
  if (ring) {
    search_around(seen.edges, *ring, kRingWindow, kStep, kHiddenFromRing, found, best);
  } else {
    search_around(seen.edges, light, kWindow, kStep, kHidden, found, best);
    if (upright) search_around(seen.edges, *upright, kWindow, kStep, kHidden, found, best);
  }
  const auto decided = [&](double least) {
    const bool many = best > least;
    if (best > 0) refine(seen.edges, ring ? kHiddenFromRing : kHidden, found);
    return many && all_around(seen.edges, heads, found.up);
  };
  bool edges = decided(kSure);
  // Lines on the ground and the walls of a room agree on wrong directions, too; how the pictures are held says which is
  // up.
  const bool other_way = upright && found.up.dot(*upright) < std::cos(kOtherWay) && best <= kBeyondDoubt;
  if (!ring && (!edges || other_way)) {
    const Upright near = found;
    best = 0;
    search_around(seen.edges, light, kWideWindow, kWideStep, kHidden, found, best);
    edges = decided(kBeyondDoubt);
    if (!edges) found = near;
  }
  if (edges) {
    found.basis = UpBasis::kEdges;
  } else if (ring) {
    found = {*ring, UpBasis::kRing};
  } else if (upright) {
    found = {*upright, UpBasis::kHeld};
  } else if (const std::optional<Vector3d> most = mostly_held_up(stance)) {
    found = {*most, UpBasis::kMajority};
  }
  return found;
}

Matrix3d upright_rotation(const Vector3d& up, const Vector3d& forward) {
  const Vector3d y = -up;
  Vector3d z = forward - forward.dot(y) * y;
  if (z.norm() < 0.2) z = Vector3d::UnitZ() - y.z() * y;
  if (z.norm() < 0.2) z = y.unitOrthogonal();
  z.normalize();
  Matrix3d R;
  R.row(0) = y.cross(z);
  R.row(1) = y;
  R.row(2) = z;
  return R;
}

}  // namespace nodal::autocalibration
