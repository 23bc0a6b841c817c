// The objective (§4.2): over all rays of a raymap, solid angle times the weighted spread of what the heads that see
// the ray say of it; with gradient and Gauss-Newton matrix.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "protocol/base/result.h"
#include "stitch/registration/head_state.h"
#include "stitch/registration/parallel.h"
#include "stitch/registration/pyramid.h"
#include "stitch/registration/tile_sums.h"

namespace nodal::registration {

struct ObjectiveSettings {
  bool max_norm = false;
  float huber = 0;  ///< levels; 0: none
  int channels = 1;
};

/// What a head's own block of the Gauss-Newton matrix is made of.
enum class Curvature : std::uint8_t {
  kOwn,     ///< its own gradients squared: never negative, too large by the noise in them
  kCommon,  ///< its gradients times those of the others on the ray: noise cancels, but so does what is not yet aligned
};

/// The sums over all rays. Slots say where a number of a head is among its `slots.count`.
struct Normal {
  int heads = 0, slots = 0;
  double cost = 0, measure = 0;
  std::vector<double> gradient;  ///< [head][slot]
  std::vector<double> blocks;    ///< [pair a <= b][slot of a][slot of b]
  std::vector<double> common;    ///< [head][slot][slot]: a head with itself, one gradient as the others see it
  std::vector<PairSums> pairs;   ///< [pair a <= b]
  std::vector<double> shared;    ///< [head] solid angle that it shares, times the planes, sr

  Normal(int heads, int slots);
  /// Mean squared difference, levels squared; infinite when nothing is shared.
  double objective() const;
  static int pair_count(int heads) { return heads * (heads + 1) / 2; }
  /// Index of a pair, a <= b.
  std::size_t pair(int a, int b) const { return static_cast<std::size_t>(a * heads - a * (a - 1) / 2 + (b - a)); }
  double* block(int a, int b);
  double* common_block(int head);
  /// d2 of head a's slots by head b's, whichever order.
  Eigen::MatrixXd hessian(int a, int b, Curvature curvature) const;
  Eigen::Map<const Eigen::VectorXd> gradient_of(int head) const;
  void add(const Normal& other);
};

/// One level of the problem. Lends pictures and tiles; both must outlive it.
///
/// Threading: thread-bound; evaluate() uses `workers`.
class Objective {
 public:
  /// planes[head]: at this level. `level_scale`: full-size pixels a level pixel. Heads whose `used` is false take no
  /// part.
  Objective(const std::vector<Tile>& tiles, std::vector<std::vector<PlaneRef>> planes, double level_scale,
            double margin_px, ObjectiveSettings settings, const Workers& workers);

  void set_used(std::vector<bool> used) { used_ = std::move(used); }
  void set_huber(float levels) { settings_.huber = levels; }

  /// Errors: kLensDomain when a state's lens does not rise over its region.
  Result<Normal> evaluate(const std::vector<HeadState>& heads, const Sought& sought, bool derivatives);

 private:
  /// A lens's table, kept until the lens changes.
  struct KeptTable {
    LensModel lens;
    double angle = -1;
    bool derivatives = false;
    RadialTable table;
  };
  Status tabulate(const HeadState& head, bool derivatives, KeptTable& kept) const;
  void sum_tiles(const std::vector<HeadSight>& sights, const std::vector<Slots>& slots, std::size_t first,
                 std::size_t last, bool derivatives, Normal& sums) const;

  const std::vector<Tile>& tiles_;
  std::vector<std::vector<PlaneRef>> planes_;
  double level_scale_;
  double margin_px_;
  ObjectiveSettings settings_;
  const Workers& workers_;
  std::vector<int> channels_;  ///< of each plane
  std::vector<bool> used_;
  std::vector<KeptTable> tables_;
};

/// What a head may see at most, rig frame.
struct Cone {
  Eigen::Vector3d axis;
  double reach = 0;  ///< rad
};
/// Each drawn wider by `slack` rad.
std::vector<Cone> cones_of(const std::vector<HeadState>& heads, double slack);
/// Whether any ray of a tile may be in two of the cones.
bool shared_tile(const Tile& tile, const std::vector<Cone>& cones);

}  // namespace nodal::registration
