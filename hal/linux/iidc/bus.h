// IIDC cameras as what their buses give: registers and frames. An interface, so that tests can replace the hardware.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "hal/linux/device/usb.h"
#include "hal/wake_ups.h"
#include "protocol/base/units.h"

namespace nodal::hal::iidc {

/// Texts are printable.
struct CameraInfo {
  std::uint64_t guid = 0;
  std::string vendor, model;
  /// Address of the command registers, from FFFF F000 0000h. 0: not known, because the camera was only listed.
  std::uint64_t command_base = 0;
  std::optional<device::UsbPlace> usb = std::nullopt;  ///< nothing: it is on IEEE 1394, or was only listed
};

/// A frame in one of the source's buffers.
struct RawFrame {
  std::size_t slot = 0;
  std::uint8_t* data = nullptr;
  std::size_t bytes = 0;  ///< number of bytes that arrived
  Instant at;             ///< on the rig's clock: when its transfer began, or else ended
  bool at_begin = false;
  bool damaged = false;
  std::uint32_t discarded = 0;  ///< frames before it that arrived while no buffer was free
  bool starved = false;  ///< since the frame before it no buffer was free, and an unknown number of frames was lost
};

/// The buffers of one stream, and the transfers into them.
///
/// Threading: one thread at a time. begin() and end() may take a second; the others never wait.
/// Errors: errno values. ENODEV: the camera is gone.
class FrameSource {
 public:
  virtual ~FrameSource() = default;
  /// Reserves what the bus needs, and queues every buffer that is not lent.
  virtual int begin() = 0;
  /// Ends the transfers. Lent buffers keep their content. Safe at any time.
  virtual void end() = 0;
  /// 0; EAGAIN: no frame is due; otherwise the stream is broken.
  virtual int take(RawFrame& frame) = 0;
  /// In any order. 0 or an errno, after which the slot is still lent.
  virtual int give_back(std::size_t slot) = 0;
  virtual std::size_t buffers() const = 0;
  virtual void add_wake_ups(WakeUps& to) const = 0;
};

/// An open camera.
///
/// Threading: one thread at a time, except gone(), which returns at once. The others may take seconds.
/// Errors: errno values. ENODEV: the camera is gone; EIO: it refuses, or does not answer.
class Device {
 public:
  virtual ~Device() = default;
  virtual const CameraInfo& info() const = 0;
  /// A register, by its offset from FFFF F000 0000h.
  virtual int read(std::uint64_t offset, std::uint32_t& value) = 0;
  virtual int write(std::uint64_t offset, std::uint32_t value) = 0;
  /// Whether it is unplugged, as far as the system tells at once.
  virtual bool gone() const = 0;
  /// Buffers for frames of at most `frame_bytes`, not queued yet. The video mode is set. The source ends before the
  /// device.
  virtual int make_source(std::size_t buffers, std::size_t frame_bytes, std::unique_ptr<FrameSource>& source) = 0;
};

/// Threading: thread-safe.
class Bus {
 public:
  virtual ~Bus() = default;
  /// 0; ENODEV if there is no such camera; another errno.
  virtual int open(std::uint64_t guid, std::unique_ptr<Device>& device) = 0;
  /// Asks each camera only who it is.
  virtual std::vector<CameraInfo> list() = 0;
};

/// This machine's cameras, through libdc1394.
Bus& cameras();

}  // namespace nodal::hal::iidc
