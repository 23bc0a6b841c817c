// The light that falls on a head's sensor: the scene through the lens, before any electronics.
#pragma once

#include <array>
#include <vector>

#include "hal/sim/scene/lens.h"
#include "hal/sim/scene/scene.h"
#include "protocol/calibration.h"

namespace nodal::hal::sim {

/// Linear red, green and blue of every pixel, with vignetting and the head's gain; rows packed.
struct Plate {
  int width = 0;
  int height = 0;
  std::array<std::vector<float>, 3> light;
};

/// What vignetting and gain leave of light 1 at (u, v), in red, green, blue; never below 0.
std::array<float, 3> falloff(const HeadCalibration& head, double u, double v);

/// The scene without its movers, n x n samples a pixel.
Plate expose_plate(const HeadCalibration& head, const LensTruth& lens, const Scene& scene, int supersampling);

/// A moving object at one moment: its place, and its light from a direction.
class PlacedMover {
 public:
  PlacedMover(const Mover& mover, Instant at);
  /// The share of a pixel at `from` that it covers, 0..1, and its light.
  struct Cover {
    float share = 0;
    Light light;
  };
  Cover cover(const Direction& from, double footprint_rad) const;
  /// Whether a pixel of the cap about `middle`, given by its angle's cosine and sine, may see it.
  bool may_touch(const Direction& middle, double cap_cosine, double cap_sine) const;

 private:
  /// Of a bar: how far inside its nearer edge a direction is; negative beside it.
  double inside_bar(const Direction& from) const;

  Mover::Shape shape_;
  Direction axis_;           ///< of a bar
  Direction ahead_, aside_;  ///< of a bar: its middle and what is a quarter turn on, both square to the axis
  Direction centre_, spin_, side_;
  double radius_;
  double reach_cosine_, reach_sine_;  ///< of the radius and a margin for blurred rims
  Light colour_, stripes_;
};

}  // namespace nodal::hal::sim
