// What is asked of a V4L2 device when it is opened, and what it grants.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "hal/head.h"
#include "hal/linux/v4l2/device.h"
#include "hal/linux/v4l2/layout.h"

namespace nodal::hal::v4l2 {

/// What rig.toml says of a head.
struct HeadRequest {
  PixelFormat pixels = PixelFormat::kI420;
  Fields fields = Fields::kProgressive;
  FrameRate rate;
  int width = 0;  ///< with height; 0: as the device comes
  int height = 0;
  std::string input;     ///< by name, such as "S-Video", or number; empty: as the device comes
  std::string standard;  ///< "NTSC", "PAL", "SECAM" or one of their variants; empty: as the device comes
  /// Thousandths of a decibel that one step of the device's gain control is, since V4L2 gives gain no unit; 0: the gain
  /// is left as it is.
  std::int32_t gain_step_mdb = 0;
  /// From the middle of a frame's exposure plus half of it to the device's timestamp; nothing: one frame period.
  std::optional<Duration> readout;
  int buffers = 4;  ///< that are asked for; the driver grants what it likes
};

struct Granted {
  HeadFormat format;
  Layout layout;
  bool video_range = false;                  ///< Y U V of 16..235 come, although full range was asked for
  Fields interlaced = Fields::kProgressive;  ///< what V4L2_FIELD_INTERLACED means in this standard
  std::uint32_t input = 0;
  Duration readout;
};

/// Sets input, standard, format, size and rate.
/// Errors: kUnsupported when the device has no such input, standard, format, size, rate or field order, naming those
///   that it has; kBusy when another program streams from it; those of explain().
Result<Granted> negotiate(const Device& device, const HeadRequest& request);

/// What a V4L2 field order says of a frame; nothing for those that this port does not take, such as alternate fields.
std::optional<Fields> fields_of(std::uint32_t field, Fields interlaced);

/// Whether the input says that it has no picture. False when it does not tell.
bool no_signal(const Device& device, std::uint32_t input);

}  // namespace nodal::hal::v4l2
