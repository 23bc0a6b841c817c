// Opens V4L2 devices as heads.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "hal/linux/device/enumerator.h"
#include "hal/linux/device/usb.h"
#include "hal/linux/v4l2/negotiation.h"
#include "hal/linux/v4l2/system.h"

namespace nodal::hal::v4l2 {

/// A path is "v4l2:" and a name for open_device().
///
/// Threading, Errors: as device::DeviceEnumerator.
/// Ownership: refers to the clock and the system; destroy heads first.
class V4l2Enumerator final : public device::DeviceEnumerator {
 public:
  /// `buses`: of other heads on USB, which share the bandwidth.
  explicit V4l2Enumerator(ClockPort& clock, System& system = kernel(), const device::UsbBuses& buses = {});

  /// Sets the request for the device at `path`, used when it is opened. Starts the path's worker.
  void request(const std::string& path, const HeadRequest& request);

  /// Opens every device of the machine briefly, which may take seconds: not for the capture thread.
  std::vector<HeadIdentity> list() override;

 private:
  Attempt usual_attempt(const std::string& path) override { return attempt(path, {}); }
  Attempt attempt(const std::string& path, const HeadRequest& request);
  std::unique_ptr<HeadPort> make_head(const std::string& path, std::shared_ptr<device::Channel> channel,
                                      device::Worker& worker, ClockPort& clock, std::shared_ptr<bool> in_use) override;

  System& system_;
  const device::UsbBuses buses_;
};

}  // namespace nodal::hal::v4l2
