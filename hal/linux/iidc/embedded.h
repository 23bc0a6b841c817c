// What a camera writes into the first pixels of its pictures.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

#include "hal/linux/iidc/camera.h"

namespace nodal::hal::iidc {

/// Numbers of one frame. Point Grey cameras write them in place of the first pixels, four bytes each, high byte first:
/// those that are switched on, in the order timestamp, gain, shutter, ..., frame counter.
///
/// Source: Point Grey Research, Register Reference: FRAME_INFO, 12F8h.
struct EmbeddedInfo {
  std::uint32_t gain = 0;     ///< content of the gain register, 12 bits
  std::uint32_t shutter = 0;  ///< content of the shutter register, 12 bits
  std::uint32_t counter = 0;  ///< counter of frames
  /// Gain and shutter have their registers' fixed bits: 0 present, 8 to 19 zero. Otherwise these bytes are pixels.
  bool marked = false;
};

/// Switches gain, shutter and frame counter on, and the others off. False if the camera has no embedded numbers.
Result<bool> switch_on_embedded(Camera& camera);

/// Reads the numbers of a picture and covers them with the pixels `repeat` rows below. Nothing if it is too small.
std::optional<EmbeddedInfo> take_embedded(std::span<std::uint8_t> picture, std::size_t row_bytes, std::size_t repeat);

}  // namespace nodal::hal::iidc
