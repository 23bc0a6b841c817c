// Pictures of ideal fisheyes, for those who know their lens: layouts that are read, and in which no raymap is made.
#pragma once

#include <memory>
#include <optional>
#include <string_view>

#include "protocol/base/result.h"
#include "stitch/geometry/raymap/layout.h"

namespace nodal::geometry {

/// One equidistant fisheye that looks forward, or two back to back in the halves of the picture: left and right, or top
/// and bottom of a picture that is higher than wide. The first half looks forward, the second back, both upright. A
/// lens's circle is the largest one in the middle of the picture or of its half, `fov_deg` across.
struct FisheyePicture {
  bool dual = false;
  double fov_deg = 180;

  /// "fisheye:fov=190" or "dual_fisheye:fov=190.5". Nothing for other text. Errors: kBadValue for a field of view
  /// outside of 10 .. 360 degrees.
  static std::optional<Result<FisheyePicture>> parse(std::string_view text);

  /// The resolution along a radius of a circle.
  double pixels_per_radian(RaymapSize size) const;
  /// With two lenses, the one whose axis is closer shows a ray. RaymapLayout::solid_angle() is that of the pixel's
  /// middle.
  std::unique_ptr<RaymapLayout> layout(RaymapSize size) const;
};

}  // namespace nodal::geometry
