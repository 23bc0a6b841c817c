// The objective (§4.2): the sum over all rays of a raymap of solid angle times the weighted variance of the light that
// the heads see there; with gradient and Gauss-Newton matrix.
#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "protocol/base/result.h"
#include "stitch/parallel/workers.h"
#include "stitch/registration/head_state.h"
#include "stitch/registration/pyramid.h"
#include "stitch/registration/tile_sums.h"

namespace nodal::registration {

struct ObjectiveSettings {
  bool max_norm = false;
  float huber = 0;  ///< levels; 0: none
  int channels = 1;
};

/// How a head's own block of the Gauss-Newton matrix is computed.
enum class Curvature : std::uint8_t {
  kOwn,     ///< from its own gradients squared: never negative, but too large by their noise
  kCommon,  ///< from its gradients times the other heads' on the ray: noise cancels, but so does detail not yet aligned
};

/// The sums over all rays. `Slots` gives the index of each parameter among a head's `slots.count`.
struct Normal {
  int heads = 0, slots = 0;
  double cost = 0, measure = 0;
  std::vector<double> gradient;  ///< [head][slot]
  std::vector<double> blocks;    ///< [pair a <= b][slot of a][slot of b]
  std::vector<double> common;  ///< [head][slot][slot]: a head with itself, with one gradient taken from the other heads
  std::vector<PairSums> pairs;  ///< [pair a <= b]
  std::vector<double> shared;   ///< [head] solid angle that it shares, times the number of planes, sr

  Normal(int heads, int slots);
  /// Mean squared difference, levels squared; infinite if nothing is shared.
  double objective() const;
  static int pair_count(int heads) { return heads * (heads + 1) / 2; }
  /// Index of a pair, a <= b.
  std::size_t pair(int a, int b) const { return static_cast<std::size_t>(a * heads - a * (a - 1) / 2 + (b - a)); }
  double* block(int a, int b);
  double* common_block(int head);
  /// The second derivative by a slot of head a and a slot of head b, in either order.
  Eigen::MatrixXd hessian(int a, int b, Curvature curvature) const;
  void add(const Normal& other);
};

/// Parts of the sphere for evaluate_parts(), about 22 degrees wide.
inline constexpr int kParts = 96;
/// The number, less than 24, of the four parts around a corner that a part belongs to.
std::size_t coarse_part(std::size_t part);

/// One level of the problem. Refers to pictures and tiles; both must outlive it.
///
/// Threading: thread-bound; evaluate() uses `workers`.
class Objective {
 public:
  /// planes[head]: at this level. `level_scale`: full-size pixels per pixel of the level. Heads whose `used` is false
  /// are ignored.
  Objective(const std::vector<Tile>& tiles, std::vector<std::vector<PlaneRef>> planes, double level_scale,
            double margin_px, ObjectiveSettings settings, const parallel::Workers& workers);

  void set_used(std::vector<bool> used) { used_ = std::move(used); }
  void set_huber(float levels) { settings_.huber = levels; }

  /// Errors: kLensDomain if a state's lens is not monotonic over its region.
  Result<Normal> evaluate(const std::vector<HeadState>& heads, const Sought& sought, bool derivatives);
  /// The sums of each part of the sphere by itself, with derivatives; together they are evaluate()'s.
  Result<std::vector<Normal>> evaluate_parts(const std::vector<HeadState>& heads, const Sought& sought);

 private:
  /// The heads as the kernel reads them.
  struct Sights {
    std::vector<HeadSight> heads;
    std::vector<Slots> slots;
    int stride = 0;  ///< the largest number of slots
  };
  Result<Sights> sights_of(const std::vector<HeadState>& heads, const Sought& sought, bool derivatives);
  /// A lens's table, cached until the lens changes.
  struct KeptTable {
    LensModel lens;
    double angle = -1;
    bool derivatives = false;
    RadialTable table;
  };
  Status tabulate(const HeadState& head, bool derivatives, KeptTable& kept) const;
  void sum_tiles(const Sights& sights, std::span<const Tile* const> tiles, bool derivatives, Normal& sums) const;

  std::vector<const Tile*> tiles_;
  std::vector<std::vector<PlaneRef>> planes_;
  double level_scale_;
  double margin_px_;
  ObjectiveSettings settings_;
  const parallel::Workers& workers_;
  std::vector<int> channels_;  ///< channel of each plane
  std::vector<bool> used_;
  std::vector<KeptTable> tables_;
};

/// A cone that contains everything a head may see, in the rig frame.
struct Cone {
  Eigen::Vector3d axis;
  double reach = 0;  ///< rad
};
/// Each cone is widened by `slack` rad.
std::vector<Cone> cones_of(const std::vector<HeadState>& heads, double slack);
/// Whether any ray of a tile may be in two or more of the cones.
bool shared_tile(const Tile& tile, const std::vector<Cone>& cones);

}  // namespace nodal::registration
