// The memory that blending writes to.
#pragma once

#include <cstdint>
#include <vector>

#include "stitch/decode/frame_decoder.h"
#include "stitch/sets/blend_plan.h"
#include "stitch/sets/seam_views.h"

namespace nodal::sets {

/// All memory that blending with a plan needs, also with other seams of that plan. Allocated by the constructor,
/// outside the frame path.
///
/// Threading: written only by the SetBlend that adopted it.
struct BlendMemory {
  explicit BlendMemory(const BlendPlan& plan);

  std::vector<std::uint8_t> prepared;          ///< the prepared pictures that a table requires
  std::vector<decode::FrameDecoder> decoders;  ///< one a head
  SeamPictures seam_pictures;                  ///< the views of one set; empty where seams are not placed
};

}  // namespace nodal::sets
