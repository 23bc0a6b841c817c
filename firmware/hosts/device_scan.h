// What is plugged into the board, for hosts that ask.
#pragma once

#include <cstddef>
#include <optional>
#include <string>

#include "protocol/base/result.h"

namespace nodal::firmware {

struct DeviceList {
  std::string text;  ///< lines for people; together a rig.toml
  std::string json;
};

/// Largest text and largest JSON that a host is sent; larger ones are refused with an error.
inline constexpr std::size_t kMaxDeviceListBytes = 128U << 10;

/// Lists the devices of the board. nodald implements it on threads of its own, because a device may take seconds.
///
/// Threading: thread-bound to control; no call waits.
/// Errors: take() returns those of the system, such as a refused thread.
class DeviceScan {
 public:
  virtual ~DeviceScan() = default;
  /// Starts a scan; ignored while one runs.
  virtual void begin() = 0;
  /// The result of the scan, once; nothing while it runs, or when none was started.
  virtual std::optional<Result<DeviceList>> take() = 0;
};

}  // namespace nodal::firmware
