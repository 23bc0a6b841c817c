// The heads on devices of this machine: V4L2 devices and IIDC cameras.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "firmware/config/config.h"
#include "hal/clock.h"
#include "hal/head.h"
#include "hal/linux/iidc/enumerator.h"
#include "hal/linux/v4l2/enumerator.h"

namespace nodal::daemon {

/// Threading: thread-bound to capture.
/// Ownership: refers to the clock; destroy heads first.
class DeviceHeads final : public hal::HeadEnumerator {
 public:
  /// Requests from each device what rig.toml has for its head.
  DeviceHeads(const firmware::RigConfig& config, hal::ClockPort& clock);

  static bool opens(const std::string& path) { return path.starts_with("v4l2:") || path.starts_with("iidc:"); }
  Result<std::unique_ptr<hal::HeadPort>> open(const std::string& path) override;
  /// Waits until the device has answered: for checks before the rig runs.
  Result<std::unique_ptr<hal::HeadPort>> open_and_wait(const std::string& path);
  std::vector<hal::HeadIdentity> list() override;

 private:
  hal::device::DeviceEnumerator* of(const std::string& path) const;

  // Null when no head is on such a port.
  std::unique_ptr<hal::v4l2::V4l2Enumerator> v4l2_;
  std::unique_ptr<hal::iidc::IidcEnumerator> iidc_;
};

}  // namespace nodal::daemon
