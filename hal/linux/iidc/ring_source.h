// Frames of a camera on IEEE 1394, by libdc1394's ring of buffers.
#pragma once

#include <dc1394/dc1394.h>

#include <cstddef>
#include <memory>

#include "hal/linux/iidc/bus.h"

namespace nodal::hal::iidc {

/// The ring wants its buffers back in the order in which it gave them, stops when it has none, and is unmapped when the
/// stream ends. So every frame is copied out and its buffer returned at once; the copy is the head's, for as long as it
/// wants.
std::unique_ptr<FrameSource> make_ring_source(dc1394camera_t* camera, std::size_t buffers, std::size_t frame_bytes);

}  // namespace nodal::hal::iidc
