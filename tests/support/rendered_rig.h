// Rigs with pictures of a known scene, rendered by the simulator; it shares no projection code with the stitcher.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "hal/sim/scene/scene.h"
#include "protocol/base/image.h"
#include "protocol/calibration.h"

namespace nodal::test {

struct RenderedRig {
  Calibration truth;
  PixelFormat format = PixelFormat::kGrey8;
  std::vector<std::vector<std::uint8_t>> bytes;  ///< packed picture of each head

  /// One picture per head, stored in `bytes`.
  std::vector<ImageView> frames() const;
};

struct RenderOptions {
  PixelFormat format = PixelFormat::kGrey8;
  double noise_levels = 0;  ///< standard deviation
  std::uint64_t seed = 1;   ///< seed of the noise
  int supersampling = 3;
};
RenderedRig render_rig(const Calibration& truth, const hal::sim::ScenePtr& scene, const RenderOptions& options = {});

/// A room about the rig's nodal point: a ball of this radius, or a box with this distance to its walls, m. Its walls
/// look from the nodal point as `scene` does without its movers, and each head sees them from its own position. The
/// picture that a rig at one point would take is therefore `scene`.
struct Room {
  enum class Shape { kBall, kBox } shape = Shape::kBall;
  double size = 2;
  /// Patterned columns from floor to ceiling, nearer than the walls. With any, the picture of a rig at one point is
  /// what_a_rig_sees() from there.
  struct Column {
    double x = 0, z = 0, radius = 0.25;  ///< m
  };
  std::vector<Column> columns{};
};
/// The room as it looks from a point, m.
hal::sim::ScenePtr what_a_rig_sees(const Room& room, const std::array<double, 3>& from,
                                   const hal::sim::ScenePtr& walls);
/// How far it is from a point in a direction (a unit vector) to a wall or a column, m.
double range_in(const Room& room, const std::array<double, 3>& from, const std::array<double, 3>& direction);
RenderedRig render_rig_in(const Room& room, const Calibration& truth, const hal::sim::ScenePtr& scene,
                          const RenderOptions& options = {});

/// Tiles with a window each, on a ball: light and dark ones in turn, 10 degrees wide. They repeat every 20 degrees; the
/// light that falls on them does not, unless its unevenness is 0.
hal::sim::ScenePtr tiles_scene(double unevenness = 1);

/// Moves every head forward along its axis, m.
Calibration spread_out(Calibration rig, double forward);

/// Six equidistant fisheyes of `side` x `side` pixels with a field of `view_deg`, one along each axis of the rig.
Calibration six_fisheyes(int side, double view_deg = 130);

/// Three rings of eight equidistant heads, at pitches of -48, 0 and 48 degrees.
Calibration three_rings(int side, double view_deg);

/// Rotates every head about a random axis by `least_deg` to `most_deg`.
Calibration turned(Calibration rig, double least_deg, double most_deg, std::uint64_t seed);

/// The distance of the heads' rotations from the true ones, after the best common rotation. Heads for which `counted`
/// is false are left out; an empty `counted` includes all.
struct RotationError {
  double rms_deg = 0;
  double max_deg = 0;
};
RotationError rotation_error(const Calibration& truth, const Calibration& found, const std::vector<bool>& counted = {});

}  // namespace nodal::test
