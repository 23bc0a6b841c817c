// How a rig makes its raymaps. firmware/RIG.md explains every key and its limits.
#pragma once

#include <cstdint>
#include <functional>
#include <string>

#include "protocol/base/image.h"
#include "protocol/base/result.h"

namespace nodal {

/// Reads the file of a list of rays that a layout names, at most kMaxRayFileBytes.
using ReadRayFile = std::function<Result<std::string>(const std::string& file)>;
inline constexpr std::size_t kMaxRayFileBytes = 128 << 20;

/// How interlaced frames are blended.
enum class FieldUse : std::uint8_t {
  kWeave,     ///< the rows of both fields in one raymap, as if they were one exposure
  kSeparate,  ///< one raymap per field, each with a table for the rows of that field
};

/// How one head's picture passes into the next one's where several heads see a ray.
enum class Transition : std::uint8_t {
  kTwoBand,  ///< seams for detail; low frequencies pass as with kFeather, so that no step in brightness shows
  kSeam,     ///< only the head with the largest weight, except on a ramp along the seam: sharp
  kFeather,  ///< all heads, by their weights: blurred, and doubled where heads have different nodal points
};

/// Where seams lie between heads.
enum class SeamPlacement : std::uint8_t {
  kFixed,   ///< where the heads' weights are equal
  kPlaced,  ///< where the heads' pictures agree; moved while the rig films
};

/// What raymaps are like: [raymap] of rig.toml.
struct RaymapConfig {
  std::string layout = "equirectangular";  ///< the canonical text of a geometry::LayoutName; also in the protocol
  int width = 2048;
  int height = 1024;
  PixelFormat format = PixelFormat::kI420;  ///< one that is_raymap_format() accepts
  int jpeg_quality = 85;                    ///< 1 .. 100
  Transition transition = Transition::kTwoBand;
  /// table::TableOptions explains the two widths.
  double seam_width_deg = 1;                    ///< kTwoBand, kSeam: 0 .. 180
  SeamPlacement seams = SeamPlacement::kFixed;  ///< kTwoBand, kSeam
  double feather = 0.5;                         ///< kTwoBand, kFeather: 0.01 .. 1
  bool soft = true;                             ///< highlights beyond the sample range are compressed, not clipped
  FieldUse fields = FieldUse::kWeave;

  /// Raymaps that are made from one frame set.
  int raymaps_a_set() const { return fields == FieldUse::kSeparate ? 2 : 1; }
};

}  // namespace nodal
