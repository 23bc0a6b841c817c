// An emulated USB video camera (UVC 1.0, bulk), plugged to the guest's own USB host, where uvcvideo drives it.
#pragma once

#include <sys/types.h>

#include <atomic>
#include <cstdint>
#include <string>

#include "protocol/base/units.h"

namespace nodal::hil {

/// 160x120 YUYV, 30 frames a second. It comes, as webcams do, with its exposure set by an automatic mode, in which it
/// refuses an exposure. Every sample of a frame's luma is exposure % 256 and of its chroma gain % 256, as they were
/// when the frame was taken, but for the first four bytes: the frame's number, little-endian.
///
/// It runs in a process of its own; destroying the object, or unplug(), kills it, which is what pulling its plug does.
class UvcCamera {
 public:
  static constexpr int kWidth = 160;
  static constexpr int kHeight = 120;
  static constexpr Duration kPeriod = Duration::nanoseconds(33'333'300);
  static constexpr std::uint32_t kAutomatic = 8;  ///< aperture priority, of UVC 1.0's auto exposure modes
  static constexpr std::uint32_t kManual = 1;
  static constexpr std::uint32_t kLongest = 333;  ///< 100 us; a frame period
  static constexpr std::uint32_t kMaxGain = 255;

  /// Plugs the camera in and waits for its video node.
  UvcCamera();
  ~UvcCamera() { unplug(); }
  UvcCamera(const UvcCamera&) = delete;
  UvcCamera& operator=(const UvcCamera&) = delete;

  void unplug();
  static constexpr const char* kName = "HIL camera";
  static std::string path() { return std::string("v4l2:") + kName; }

  // The camera's registers, and what it did.
  std::uint32_t exposure() const { return device_->exposure; }  ///< 100 us
  std::uint32_t gain() const { return device_->gain; }
  std::uint32_t exposure_mode() const { return device_->mode; }
  std::uint32_t frames() const { return device_->frames; }

  // Faults.
  void refuse_controls(bool on) { device_->refuse = on; }
  /// A control's request is answered after this time.
  void answer_controls_after(Duration time) { device_->answer_after_us = static_cast<std::uint32_t>(time.us()); }
  void send_no_frames(bool on) { device_->silent = on; }
  /// The next frame ends in its middle.
  void tear_a_frame() { device_->tear = true; }

  /// Shared by the camera's process and the test's.
  struct Device {
    std::atomic<std::uint32_t> exposure{100}, gain{32}, mode{kAutomatic}, frames{0}, answer_after_us{0};
    std::atomic<bool> refuse{false}, silent{false}, tear{false}, streams{false};
  };

 private:
  Device* device_;
  pid_t process_ = -1;
};

}  // namespace nodal::hil
