// An IIDC camera: its registers as video modes, settings and triggers.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "hal/linux/iidc/bus.h"
#include "protocol/base/image.h"
#include "protocol/base/result.h"
#include "protocol/base/units.h"

namespace nodal::hal::iidc {

/// A video mode that heads can use.
struct Mode {
  int format = 0, number = 0;  ///< as the registers count them
  PixelFormat pixels = PixelFormat::kGrey8;
  int width = 0, height = 0;       ///< a scalable mode's are its largest
  std::vector<FrameRate> rates{};  ///< ascending; empty for a scalable mode, whose packet size determines the rate
  /// Format 7: a rectangle of the sensor. Its sizes are multiples of the units, its place of the place units.
  bool scalable = false;
  int width_unit = 1, height_unit = 1, left_unit = 1, top_unit = 1;
  std::uint32_t coding = 0;  ///< number of its colour coding (format 7)
  std::uint64_t place = 0;   ///< place of its registers (format 7)
};

struct Selection {
  Mode mode;
  FrameRate rate{};  ///< one of the mode's rates; for a scalable mode, the lowest that the packet size must reach
  int width = 0, height = 0, left = 0, top = 0;
  std::uint32_t packet_bytes = 0;  ///< only for a scalable mode; 0: the smallest that reaches the rate
};

struct Selected {
  std::size_t frame_bytes = 0;  ///< size of a frame on the bus, with padding
  double hertz = 0;             ///< what the camera then does by itself
};

/// The numbers that IIDC gives its features.
enum class FeatureId : std::uint8_t {
  kBrightness = 0,
  kAutoExposure = 1,
  kWhiteBalance = 3,
  kShutter = 7,
  kGain = 8,
  kFrameRate = 15,
};

struct Feature {
  bool present = false;
  bool can_switch = false;
  bool has_auto = false;                       ///< has an automatic mode
  bool absolute = false;                       ///< has absolute values: seconds, decibels, frames per second
  std::uint32_t low = 0, high = 0, value = 0;  ///< `value` of kWhiteBalance is that of red
  std::uint32_t blue = 0;                      ///< only for kWhiteBalance
  float absolute_low = 0, absolute_high = 0, absolute_value = 0;
};

struct TriggerChoice {
  bool pulse_width = false;  ///< mode 1: the pulse is the exposure; otherwise mode 0: its edge starts it
  bool active_high = true;
};

struct TriggerAbility {
  bool edge = false;         ///< mode 0
  bool pulse_width = false;  ///< mode 1
};

/// "iidc:00b09d0100c0ffee", as in rig.toml.
std::string port_of(std::uint64_t guid);

/// Explains a failed call in one sentence. `doing` is the attempted action, such as "setting the gain".
Error explain(const std::string& head, const std::string& doing, int error);

/// What is switched or selected is read back after it was written, because a camera may ignore it. Values of settings
/// are read back by Controls, because a camera may change them.
///
/// Threading: one thread at a time, except gone(). Calls may take seconds.
/// Errors: kDeviceGone, kDeviceFailed, kBandwidth, kBusy, kUnsupported; one sentence that names the head.
class Camera {
 public:
  Camera(std::unique_ptr<Device> device, std::string head) : device_(std::move(device)), head_(std::move(head)) {}

  const CameraInfo& info() const { return device_->info(); }
  const std::string& head() const { return head_; }
  bool gone() const { return device_->gone(); }
  Error explained(const std::string& doing, int error) const { return explain(head_, doing, error); }

  /// Ends the stream of an earlier program, and switches the camera on.
  Status prepare();
  Result<std::vector<Mode>> modes();
  /// Sets a mode; the camera does not transmit.
  Result<Selected> select(const Selection& selection);

  Result<Feature> feature(FeatureId id);
  /// Switches the feature on and its automatic mode off, and its absolute values on if it has them.
  Status set_manual(FeatureId id);
  Status switch_off(FeatureId id);
  Status set_value(FeatureId id, std::uint32_t value);
  Status set_absolute(FeatureId id, float value);
  Status set_white_balance(std::uint32_t blue, std::uint32_t red);

  Result<TriggerAbility> trigger();
  /// Nothing: the camera runs free.
  Status set_trigger(const std::optional<TriggerChoice>& choice);
  Status transmit(bool on);
  Result<std::unique_ptr<FrameSource>> make_source(int buffers, std::size_t frame_bytes);

  /// A command register, by its offset from their base. `doing` is for the error.
  Result<std::uint32_t> read(std::uint32_t offset, const std::string& doing) {
    return read_at(info().command_base + offset, doing);
  }
  Status write(std::uint32_t offset, std::uint32_t value, const std::string& doing) {
    return write_at(info().command_base + offset, value, doing);
  }

 private:
  Result<std::uint32_t> read_at(std::uint64_t offset, const std::string& doing);
  Status write_at(std::uint64_t offset, std::uint32_t value, const std::string& doing);
  /// Writes, and reads back: the bits of `mask` must be those that were written.
  Status put(std::uint64_t offset, std::uint32_t value, std::uint32_t mask, const std::string& doing);
  Result<std::uint64_t> absolute_place(FeatureId id);

  Status add_fixed_modes(int format, std::vector<Mode>& modes);
  Status add_scalable_modes(std::vector<Mode>& modes);
  Status set_mode(const Mode& mode);
  Result<Selected> select_fixed(const Selection& selection);
  Result<Selected> select_scalable(const Selection& selection);
  Status apply(const Mode& mode, std::uint32_t error_bit, const std::string& doing);

  const std::unique_ptr<Device> device_;
  const std::string head_;
};

}  // namespace nodal::hal::iidc
