// Frames of a USB camera, by bulk transfers of libusb.
#pragma once

#include <cstddef>
#include <memory>

#include "hal/linux/iidc/bus.h"

namespace nodal::hal::iidc {

/// libdc1394 is not used for this. Its capture on USB makes a thread, blocks in read() when frames complete in another
/// order than it expects, hands buffers out in that order only, and at the end frees transfers that are still in
/// flight. Here the transfers belong to the thread that takes frames: libusb's descriptors wake it, and take() handles
/// what has completed.
///
/// A camera sends each frame as one bulk transfer, which a short packet ends, or its length. `bus` and `address` are
/// the camera's; it is opened a second time, and only the interface of its stream is claimed. 0 or an errno.
int make_usb_source(int bus, int address, std::size_t buffers, std::size_t frame_bytes,
                    std::unique_ptr<FrameSource>& source);

}  // namespace nodal::hal::iidc
