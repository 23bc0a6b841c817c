// Lists what is plugged in, for hosts, while the rig runs.
#pragma once

#include <chrono>
#include <memory>
#include <vector>

#include "firmware/daemon/drivers.h"
#include "firmware/hosts/device_scan.h"
#include "hal/linux/iidc/lister.h"
#include "hal/linux/v4l2/scan.h"

namespace nodal::daemon {

/// After this time a device that has not answered a scan is listed as such. uvcvideo waits 5 s for each control of a
/// device that does not answer. Shorter than the 10 s after which `nodal` asks whether the rig is alive.
inline constexpr std::chrono::milliseconds kScanWithin = std::chrono::seconds(8);

/// V4L2 devices with their modes, and IIDC cameras, which are only listed: opening one would disturb a stream.
///
/// Threading: one thread at a time.
/// Ownership: system and bus outlive the process's threads: a device that hangs is never waited for.
class MachineDevices {
 public:
  explicit MachineDevices(hal::v4l2::System& system = v4l2_drivers(), hal::iidc::Bus& bus = iidc_cameras())
      : v4l2_(system), iidc_(bus) {}
  std::vector<hal::v4l2::FoundDevice> scan(std::chrono::milliseconds patience);

 private:
  hal::v4l2::Scanner v4l2_;
  hal::iidc::Lister iidc_;
};

/// Scans on a thread of its own. Its destructor does not wait for a scan, whose results are then dropped.
class DeviceScanner final : public firmware::DeviceScan {
 public:
  DeviceScanner();
  void begin() override;
  std::optional<Result<firmware::DeviceList>> take() override;

 private:
  struct Shared;
  const std::shared_ptr<Shared> shared_;
};

}  // namespace nodal::daemon
