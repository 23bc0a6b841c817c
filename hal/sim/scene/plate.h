// The light on a head's sensor: the scene through the lens, before the electronics.
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

/// The factors of vignetting and gain at (u, v) for red, green, blue; never below 0.
std::array<float, 3> falloff(const HeadCalibration& head, double u, double v);

/// Renders the scene without its movers, n x n samples per pixel.
Plate expose_plate(const HeadCalibration& head, const LensTruth& lens, const Scene& scene, int supersampling);

/// A moving object at one moment: its position, and its light in a direction.
class PlacedMover {
 public:
  PlacedMover(const Mover& mover, Instant at);
  /// The share of a pixel in direction `from` that it covers, 0..1, and its light.
  struct Cover {
    float share = 0;
    Light light;
  };
  Cover cover(const Direction& from, double footprint_rad) const;
  /// Whether a pixel inside the cap around `middle`, given by the cosine and sine of its angle, may see it.
  bool may_touch(const Direction& middle, double cap_cosine, double cap_sine) const;

 private:
  /// For a bar: the distance of a direction inside the bar's nearer edge; negative outside.
  double inside_bar(const Direction& from) const;

  Mover::Shape shape_;
  Direction axis_;  ///< direction of a bar's axis
  /// Directions to a bar's middle, and a quarter turn further; both perpendicular to the axis.
  Direction ahead_, aside_;
  Direction centre_, spin_, side_;
  double radius_;
  double reach_cosine_, reach_sine_;  ///< cosine and sine of the radius plus a margin for blurred rims
  Light colour_, stripes_;
};

}  // namespace nodal::hal::sim
