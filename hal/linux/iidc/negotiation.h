// What is requested from an IIDC camera when it is opened, and what it grants.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "hal/head.h"
#include "hal/linux/iidc/camera.h"

namespace nodal::hal::iidc {

/// A head's settings in rig.toml.
struct HeadRequest {
  PixelFormat pixels = PixelFormat::kUyvy;
  FrameRate rate;
  int width = 0;  ///< with height; 0: the largest that has the rate
  int height = 0;
  std::optional<int> left, top;    ///< with both, a rectangle of the sensor (format 7)
  std::uint32_t packet_bytes = 0;  ///< only for format 7; 0: the smallest that carries the rate
  bool triggered = false;          ///< pulses will determine the rate; the mode's own may be faster
  TriggerChoice trigger;
  Duration pulse_width;             ///< the exposure with trigger.pulse_width
  std::int32_t gain_step_mdb = 0;   ///< gain step of cameras whose gain is not in decibels; 0: the gain is not changed
  std::optional<Duration> readout;  ///< time from the end of the exposure to the timestamp
  int buffers = 4;
};

struct Granted {
  HeadFormat format;
  std::size_t frame_bytes = 0;    ///< size of a frame in memory, with padding
  std::size_t picture_bytes = 0;  ///< size of the picture within the frame
};

/// Chooses and sets a video mode.
/// Errors: kUnsupported if the camera has no such format, size, place or rate, naming those that it has; those of
/// Camera.
Result<Granted> negotiate(Camera& camera, const std::string& head, const HeadRequest& request);

}  // namespace nodal::hal::iidc
