// Lists what is plugged in, for hosts, while the rig runs.
#pragma once

#include <chrono>
#include <memory>

#include "firmware/hosts/device_scan.h"
#include "hal/linux/v4l2/system.h"

namespace nodal::daemon {

/// After this time a device that has not answered a scan is listed as such. uvcvideo waits 5 s for each control of a device
/// that does not answer. Shorter than the 10 s after which `nodal` asks whether the rig is alive.
inline constexpr std::chrono::milliseconds kScanWithin = std::chrono::seconds(8);

/// Scans on a thread of its own. Its destructor does not wait for a scan, whose results are then dropped.
class DeviceScanner final : public firmware::DeviceScan {
 public:
  /// The system outlives the process's threads: a device that hangs is never waited for.
  explicit DeviceScanner(hal::v4l2::System& system = hal::v4l2::kernel());
  void begin() override;
  std::optional<Result<firmware::DeviceList>> take() override;

 private:
  struct Shared;
  const std::shared_ptr<Shared> shared_;
};

}  // namespace nodal::daemon
