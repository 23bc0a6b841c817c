// The scene that the simulated heads see, as light by direction. Values are linear: 1 fills a head's pixel at its
// reference exposure, 0 dB and no vignetting; larger values clip.
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "protocol/base/image.h"
#include "protocol/base/result.h"
#include "protocol/base/units.h"
#include "protocol/calibration.h"

namespace nodal::hal::sim {

/// A unit direction in the rig frame: x right, y down, z forward.
struct Direction {
  double x = 0, y = 0, z = 1;
};

inline double dot(const Direction& a, const Direction& b) { return a.x * b.x + a.y * b.y + a.z * b.z; }

/// Linear red, green, blue.
struct Light {
  float r = 0, g = 0, b = 0;
};

/// An object that moves in front of the background, around `axis` once per `period`.
struct Mover {
  enum class Shape {
    kBall,  ///< striped, moves on a small circle
    kBar,   ///< the area between two meridians of the axis, from pole to pole; one colour
  };
  Direction axis;
  Direction start;        ///< its direction at time 0
  Duration period;        ///< negative: moves in the other direction
  double radius_rad = 0;  ///< seen from the nodal point; for a bar, half the angle between its meridians
  Light colour, stripes;
  Shape shape = Shape::kBall;
};

/// Threading: thread-safe; immutable.
/// Ownership: none.
/// Errors: none.
class Scene {
 public:
  virtual ~Scene() = default;
  /// The light of the static scene in one direction; detail finer than `footprint_rad` is filtered out.
  virtual Light light(const Direction& from, double footprint_rad) const = 0;
  virtual std::span<const Mover> movers() const { return {}; }
};
using ScenePtr = std::shared_ptr<const Scene>;

/// The same light in every direction.
ScenePtr constant_scene(Light light);

/// A bright bar that rotates in front of a grey room, forward at time 0. Its edges are two meridians of `axis`,
/// `half_rad` to each side of its middle. Their position at any time is a simple formula, so the scene reveals heads
/// and fields that were not exposed at the same time.
ScenePtr bar_scene(const Direction& axis, Duration period, double half_rad);

/// The default scene: a town square by day, with the words FRONT (z), RIGHT, BACK and LEFT on its walls and balloons
/// that fly around it. Detailed at every scale, without a singular direction.
ScenePtr town_square_scene(std::uint64_t seed = 1);

/// An equirectangular photograph (RGB24 or grey, twice as wide as high): the middle column is forward, the top row is
/// up. `encoding` gives its values as a function of light.
/// Errors: kUnsupported for another pixel format, kBadValue for another shape.
Result<ScenePtr> photo_scene(const ImageView& equirectangular, const Response& encoding);

}  // namespace nodal::hal::sim
