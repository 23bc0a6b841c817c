// Options of a table; stitch/table/README.md gives the measurements behind the defaults.
#pragma once

#include <cstdint>
#include <optional>

#include "protocol/base/field.h"
#include "protocol/base/raymap_config.h"

namespace nodal::table {

enum class Interpolation : std::uint8_t {
  kPixel,  ///< bilinear in the pixel's fractions
  kRay,    ///< bilinear in the rays of the four neighbours (§4.5), where that differs (RaySampler::kSamePlace)
};

inline constexpr double kWidestSeamDeg = 180;

struct TableOptions {
  Interpolation interpolation = Interpolation::kRay;
  Transition transition = Transition::kTwoBand;
  /// kTwoBand, kSeam: width of the ramp across a seam, in degrees on the sphere, 0 (no ramp) .. kWidestSeamDeg; at the
  /// edge of a head's region its weight is 0 for every width. In degrees, because parallax and registration errors,
  /// which the ramp hides, are angles, and because the width is then independent of the raymap's size.
  double seam_width_deg = 1;
  /// kTwoBand, kFeather: the distance from the edge of a head's region from which on its weight is not reduced,
  /// relative to half the region's shorter side.
  double feather = 0.5;
  /// Heads with a smaller share of a sample than this do not contribute to it.
  double least_weight = 1.0 / 1024;
  /// Source::sharpen of every head, in 1/64, 0 .. 16: restores part of the fine detail that bilinear interpolation
  /// loses. The loss is largest at the highest spatial frequencies, where a head's picture holds mostly noise;
  /// sharpening amplifies the middle frequencies instead.
  int sharpen = 1;
  /// Undo each head's vignetting, and each head's gain.
  bool undo_vignetting = true;
  bool undo_gain = true;
  /// Levels of the heads' pyramids that may be used where the raymap shows a head much smaller than its picture: 1
  /// (only the picture itself) .. 5.
  int levels = 5;
  /// kTwoBand, kSeam: compiles BlendTable::cover, too, as long as the rest. Without it the bytes are the same unless a
  /// head is missing or heads had different exposures.
  bool cover = true;
  /// Compiles the table for this field of every head's frames. The blend gets the field as a picture of half the rows
  /// (field_of); coordinates take into account which lines of the frame the field holds. Nothing: whole frames.
  std::optional<FieldParity> field = std::nullopt;
};

}  // namespace nodal::table
