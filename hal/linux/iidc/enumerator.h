// Opens IIDC cameras as heads.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "hal/linux/device/enumerator.h"
#include "hal/linux/device/usb.h"
#include "hal/linux/iidc/bus.h"
#include "hal/linux/iidc/negotiation.h"

namespace nodal::hal::iidc {

/// A path is "iidc:" and the camera's GUID in hexadecimal.
///
/// Threading, Errors: as device::DeviceEnumerator.
/// Ownership: refers to the clock and the bus; destroy heads first.
class IidcEnumerator final : public device::DeviceEnumerator {
 public:
  /// `buses`: of other heads on USB, which share the bandwidth.
  explicit IidcEnumerator(ClockPort& clock, Bus& bus = cameras(), const device::UsbBuses& buses = {});

  /// Sets the request for the camera at `path`, used when it is opened. Starts the path's worker.
  void request(const std::string& path, const HeadRequest& request);

  /// Asks every camera of the machine who it is, which may take seconds: not for the capture thread.
  std::vector<HeadIdentity> list() override;

 private:
  Attempt usual_attempt(const std::string& path) override { return attempt(path, {}); }
  Attempt attempt(const std::string& path, const HeadRequest& request);
  std::unique_ptr<HeadPort> make_head(const std::string& path, std::shared_ptr<device::Channel> channel,
                                      device::Worker& worker, ClockPort& clock, std::shared_ptr<bool> in_use) override;

  Bus& bus_;
  const device::UsbBuses buses_;
};

}  // namespace nodal::hal::iidc
