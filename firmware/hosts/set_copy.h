// A copy of one frame set's pictures, for a host that requested them.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include "firmware/frame/frame_set.h"

namespace nodal::firmware {

/// A frame set's pictures, packed one after the other without gaps: the bytes of the heads that are in the set, and no
/// others.
struct SetCopy {
  struct Place {
    HeadShape shape;
    std::size_t room = 0;  ///< bytes of its largest picture
    // Filled in by fill().
    std::size_t offset = 0;  ///< bytes from the begin of the copy
    std::size_t bytes = 0;
    ColourCoding coding;
    hal::HeadSettings in_effect;
  };
  std::array<Place, kMaxHeads> places;
  HeadMask wanted = 0;  ///< heads with an entry in `places`
  std::shared_ptr<std::vector<std::uint8_t>> bytes;

  // Filled in by fill().
  std::uint64_t set = 0;
  Instant mid_exposure;
  SyncEvidence sync;
  HeadMask heads = 0;  ///< heads whose pictures were copied

  /// Reserves a place for each head whose shape is known; `bytes` is resized to hold all of them. A JPEG gets the room
  /// of the same picture as I420.
  static SetCopy places_for(const HeadShapes& heads, std::shared_ptr<std::vector<std::uint8_t>> bytes);
  /// Copies the pictures and shortens `bytes` to what they take, because a reader adds up the sizes of the listed
  /// heads. Skips a head that is not in the set, or whose picture has another shape than its place or does not fit into
  /// it.
  void fill(const FrameSet& from);
};

}  // namespace nodal::firmware
