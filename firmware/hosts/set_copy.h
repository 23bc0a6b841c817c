// A copy of one frame set's pictures, for a host that asks for them.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include "firmware/frame/frame_set.h"

namespace nodal::firmware {

/// A frame set's pictures, packed one after the other.
struct SetCopy {
  struct Place {
    HeadShape shape;
    std::size_t offset = 0;  ///< in bytes
    hal::HeadSettings in_effect;
  };
  std::array<Place, kMaxHeads> places;
  HeadMask wanted = 0;  ///< heads that have a place
  std::shared_ptr<std::vector<std::uint8_t>> bytes;

  // Filled in by fill().
  std::uint64_t set = 0;
  Instant mid_exposure;
  SyncEvidence sync;
  HeadMask heads = 0;  ///< whose pictures are there

  /// Places for the heads whose shape is known and not MJPEG; `bytes` is resized to hold them.
  static SetCopy places_for(const HeadShapes& heads, std::shared_ptr<std::vector<std::uint8_t>> bytes);
  /// Copies the pictures; a head that is away, or whose picture is not of the promised shape, is left out.
  void fill(const FrameSet& from);
};

}  // namespace nodal::firmware
