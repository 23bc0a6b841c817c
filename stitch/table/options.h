// Options of a table; stitch/table/README.md gives the measurements behind the defaults.
#pragma once

#include <cstdint>
#include <optional>

#include "protocol/base/field.h"

namespace nodal::table {

enum class Interpolation : std::uint8_t {
  kPixel,  ///< bilinear in the pixel's fractions
  kRay,    ///< bilinear in the rays of the four neighbours (§4.5), where that differs (RaySampler::kSamePlace)
};

/// How one head's picture passes into the next one's, where several see a ray.
enum class Transition : std::uint8_t {
  kSeam,     ///< the head with the largest weight alone, but for a ramp about the seam: sharp
  kFeather,  ///< all of them, by their weights: soft, and double where heads have different nodal points
};

inline constexpr double kWidestSeamDeg = 180;

struct TableOptions {
  Interpolation interpolation = Interpolation::kRay;
  Transition transition = Transition::kFeather;
  /// kSeam: width of the ramp across a seam, in degrees on the sphere, 0 (no ramp) .. kWidestSeamDeg; at the edge of a
  /// head's region its weight is 0 however wide the seam is. In degrees, because it hides what is measured in degrees:
  /// parallax, and errors of registration; and because it then is the same for every size of raymap.
  double seam_width_deg = 1;
  /// kFeather: the distance from the edge of its region at which a head's weight is full, relative to half the region's
  /// shorter side.
  double feather = 0.5;
  /// Heads with less than this share of a sample are left out of it.
  double least_weight = 1.0 / 1024;
  /// Source::sharpen of every head, in 1/64, 0 .. 16: gives back part of what mixing four samples takes from fine
  /// detail. It takes most from the finest, which in a head's picture is noise, and so the middle is lifted.
  int sharpen = 1;
  /// Undo each head's vignetting, and each head's gain.
  bool undo_vignetting = true;
  bool undo_gain = true;
  /// Levels of the heads' pyramids that may be used where the raymap shows a head much smaller than it is: 1, the picture
  /// alone, .. 5.
  int levels = 5;
  /// Made for this field of every head's frames, each an exposure of its own, and its lines where they lie in the frame;
  /// the blend is given the field as a picture of half the rows (field_of). Nothing: for whole frames.
  std::optional<FieldParity> field = std::nullopt;
};

}  // namespace nodal::table
