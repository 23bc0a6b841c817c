// What is requested from a V4L2 device when it is opened, and what it grants.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "hal/head.h"
#include "hal/linux/v4l2/device.h"
#include "hal/linux/v4l2/layout.h"

namespace nodal::hal::v4l2 {

/// A head's settings in rig.toml.
struct HeadRequest {
  PixelFormat pixels = PixelFormat::kI420;
  Fields fields = Fields::kProgressive;
  FrameRate rate;
  int width = 0;  ///< with height; 0: the device's present size
  int height = 0;
  std::string input;     ///< name, such as "S-Video", or number; empty: unchanged
  std::string standard;  ///< "NTSC", "PAL", "SECAM" or one of their variants; empty: unchanged
  /// Thousandths of a decibel per step of the device's gain control, because V4L2's gain has no unit; 0: the gain is
  /// not changed.
  std::int32_t gain_step_mdb = 0;
  /// From the end of a frame's exposure to the device's timestamp; nothing: one frame period.
  std::optional<Duration> readout;
  int buffers = 4;  ///< number to request; the driver may grant another number
  /// Asks for each field of an interlaced frame in a buffer of its own, also where the driver could deliver frames.
  bool separate_fields = false;
};

/// How a driver delivers the two fields of an interlaced frame.
enum class FieldStorage : std::uint8_t {
  kTogether,    ///< as alternate rows of one picture
  kAlternate,   ///< each field has its own buffer
  kSequential,  ///< both fields are in one buffer, one after the other
};

struct Granted {
  HeadFormat format;
  Layout layout;  ///< layout of a buffer's picture: a field with kAlternate, otherwise a frame
  FieldStorage storage = FieldStorage::kTogether;
  ColourCoding coding;                       ///< what the driver delivers although full-range BT.601 was requested
  Fields interlaced = Fields::kProgressive;  ///< the meaning of V4L2_FIELD_INTERLACED in this standard
  std::uint32_t input = 0;
  Duration readout;  ///< with kAlternate, of the field that is exposed first
};

/// Sets input, standard, format, size and rate.
/// Errors: kUnsupported if the device has no such input, standard, format, size, rate or field order, naming those that
///   it has; kBusy if another program streams from it; those of explain().
Result<Granted> negotiate(const Device& device, const HeadRequest& request);

/// The meaning of a V4L2 field order; nothing for unknown ones.
std::optional<Fields> fields_of(std::uint32_t field, Fields interlaced);

/// Whether the input reports that it has no picture. False if it does not report this.
bool no_signal(const Device& device, std::uint32_t input);

}  // namespace nodal::hal::v4l2
