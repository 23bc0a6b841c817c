// An emulated IIDC camera on USB, plugged to the guest's own USB host, where libdc1394 finds it.
#pragma once

#include <sys/types.h>

#include <atomic>
#include <cstdint>
#include <string>

#include "hal/linux/iidc/enumerator.h"
#include "protocol/base/units.h"

namespace nodal::hil {

/// With the registers of test::IidcRegisters, and USB's numbers of a Point Grey Firefly MV. A frame is one bulk
/// transfer. Its first numbers are the embedded gain, shutter and counter when they are on; every other byte is the
/// shutter's register % 256, in the last row the counter % 256. A new shutter or gain is in the third frame that begins
/// after it was written. Frames that nobody takes are lost, and counted.
///
/// When triggered, its counter is the number of pulses since it was plugged in, and it ignores those that come during
/// an exposure and its readout. In trigger mode 1 the pulse is the exposure.
///
/// It runs in a process of its own; destroying the object, or unplug(), kills it, which is what pulling its plug does.
class IidcCamera {
 public:
  static constexpr Duration kReadout = Duration::milliseconds(2);  ///< from an exposure's end to its frame's transfer

  /// Plugs the camera to controller `number` of dummy_hcd and waits until the kernel has it. Its trigger input is the
  /// line whose level is in the file `wire`, sampled every 0.5 ms; empty: pulse().
  explicit IidcCamera(int number = 0, std::string wire = {});
  ~IidcCamera() { unplug(); }
  IidcCamera(const IidcCamera&) = delete;
  IidcCamera& operator=(const IidcCamera&) = delete;

  void unplug();
  static constexpr const char* kPath = "iidc:00b09d0100c0ffee";  ///< address of camera 0
  std::string path() const;
  /// Grey, 48x32, 30 frames a second.
  static hal::iidc::HeadRequest request();

  // The camera's registers, and what it did.
  float shutter() const { return device_->shutter; }  ///< seconds
  float gain() const { return device_->gain; }        ///< decibels
  std::uint32_t trigger() const { return device_->trigger; }
  std::uint32_t sent() const { return device_->sent; }
  bool transmits() const { return device_->transmits; }

  // Faults.
  void refuse_writes(bool on) { device_->refuse = on; }
  void answer_writes_after(Duration time) { device_->answer_after_us = static_cast<std::uint32_t>(time.us()); }
  void send_no_frames(bool on) { device_->silent = on; }
  /// The next one ends in its middle. If that is where a packet ends, the next picture follows in the same transfer.
  void tear_a_frame() { device_->tear = true; }
  void skip_a_frame() { device_->skip = true; }  ///< the next one is counted and not sent
  void pulse() { ++device_->pulses; }            ///< on its trigger input

  /// Shared by the camera's process and the test's.
  struct Device {
    std::atomic<float> shutter{0}, gain{0};
    std::atomic<std::uint32_t> trigger{0}, sent{0}, answer_after_us{0}, pulses{0};
    std::atomic<bool> transmits{false}, refuse{false}, silent{false}, tear{false}, skip{false};
  };

 private:
  const int number_;
  Device* device_;
  pid_t process_ = -1;
};

}  // namespace nodal::hil
