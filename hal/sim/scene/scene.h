// What the simulated heads look at, as light by direction. Values are linear: 1 is what fills a head's pixel at
// its reference exposure, 0 dB and no vignetting; brighter things clip.
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

/// Linear red, green, blue.
struct Light {
  float r = 0, g = 0, b = 0;
};

/// An object that moves before the background, about `axis` once per `period`.
struct Mover {
  enum class Shape {
    kBall,  ///< striped, on a small circle
    kBar,   ///< the lune between two meridians of the axis, from pole to pole; of one colour
  };
  Direction axis;
  Direction start;        ///< where it is at time 0
  Duration period;        ///< negative: turns in the other direction
  double radius_rad = 0;  ///< as seen from the nodal point; of a bar, half the angle between its meridians
  Light colour, stripes;
  Shape shape = Shape::kBall;
};

/// Threading: thread-safe; immutable.
/// Ownership: none.
/// Errors: none.
class Scene {
 public:
  virtual ~Scene() = default;
  /// Light of what does not move, from one direction; detail finer than `footprint_rad` is left out.
  virtual Light light(const Direction& from, double footprint_rad) const = 0;
  virtual std::span<const Mover> movers() const { return {}; }
};
using ScenePtr = std::shared_ptr<const Scene>;

/// The same light from everywhere.
ScenePtr constant_scene(Light light);

/// A bright bar that turns before a grey room, forward at time 0. Its edges are two meridians of `axis`, `half_rad` either
/// way of its middle, and where they are at any moment takes one line of trigonometry: it shows heads and fields that were
/// not exposed together.
ScenePtr bar_scene(const Direction& axis, Duration period, double half_rad);

/// The default: a town square by day, walls to the front (z) lettered FRONT, RIGHT, BACK and LEFT, with balloons
/// that fly round it. Rich at every scale, no singular direction.
ScenePtr town_square_scene(std::uint64_t seed = 1);

/// An equirectangular photograph (RGB24 or grey, twice as wide as high): the middle column is forward, the top
/// row is up. `encoding` says how its values come from light.
/// Errors: kUnsupported for another pixel format, kBadValue for another shape.
Result<ScenePtr> photo_scene(const ImageView& equirectangular, const Response& encoding);

}  // namespace nodal::hal::sim
