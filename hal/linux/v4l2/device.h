// Finds a V4L2 device by name and keeps it open.
#pragma once

#include <linux/videodev2.h>

#include <memory>
#include <string>
#include <vector>

#include "hal/head.h"
#include "hal/linux/v4l2/system.h"

namespace nodal::hal::v4l2 {

/// An open capture device.
///
/// Threading: two threads may call it as long as their driver calls do not depend on each other; see head.h.
/// Ownership: closes its descriptor; the system outlives it.
class Device {
 public:
  Device(System& system, int fd, std::string head, std::string node, const v4l2_capability& capability);
  ~Device();
  Device(const Device&) = delete;
  Device& operator=(const Device&) = delete;

  System& system() const { return system_; }
  int fd() const { return fd_; }
  int ioctl(unsigned long request, void* argument) const { return system_.ioctl(fd_, request, argument); }
  /// The head's name in rig.toml, for messages.
  const std::string& head() const { return head_; }
  const std::string& node() const { return node_; }
  std::string card() const;
  std::string bus() const;
  bool multiplanar() const { return multiplanar_; }
  v4l2_buf_type buffer_type() const;

  Error explained(const std::string& doing, int error) const { return explain(head_, doing, error); }

 private:
  System& system_;
  const int fd_;
  const std::string head_;
  const std::string node_;
  const v4l2_capability capability_;
  const bool multiplanar_;
};

/// Opens the device `name`: a path (/dev/video0, or a link to one), a name in /dev/v4l/by-path or by-id, or the bus
/// ("usb-0000:00:14.0-2.1", "platform:vivid-000") or card name that the driver reports. `head` is the name for
/// messages. May take seconds, because drivers wake up devices.
/// Errors: kNoSuchDevice, also for devices that do not capture; kBadValue if several devices have that card name.
Result<std::unique_ptr<Device>> open_device(System& system, const std::string& head, const std::string& name);

/// All capture devices that can be opened now, by bus name, or by node if two share a bus.
std::vector<HeadIdentity> list_devices(System& system);

}  // namespace nodal::hal::v4l2
