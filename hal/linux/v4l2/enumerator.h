// Opens V4L2 devices as heads.
#pragma once

#include <map>
#include <memory>
#include <string>
#include <vector>

#include "hal/clock.h"
#include "hal/head.h"
#include "hal/linux/v4l2/negotiation.h"
#include "hal/linux/v4l2/system.h"

namespace nodal::hal::v4l2 {

/// A path is "v4l2:" and a name for open_device(). Each path has a worker thread that opens its device, so a device
/// that is slow or hangs does not delay the others.
///
/// Threading: thread-bound to capture. The destructor waits for calls in progress.
/// Ownership: refers to the clock and the system; destroy heads first.
/// Errors: open() returns kNotReady during the first attempt at a path; during later attempts it returns the result of
///   the last one. kBusy if the path is open.
class V4l2Enumerator final : public HeadEnumerator {
 public:
  explicit V4l2Enumerator(ClockPort& clock, System& system = kernel());
  ~V4l2Enumerator() override;

  /// Sets the request for the device at `path`, used when it is opened. Starts the path's worker.
  void request(const std::string& path, const HeadRequest& request);

  Result<std::unique_ptr<HeadPort>> open(const std::string& path) override;
  /// Opens every device of the machine briefly, which may take seconds: not for the capture thread.
  std::vector<HeadIdentity> list() override;

  /// Like open(), but waits until the device has answered: for checks before the rig runs.
  Result<std::unique_ptr<HeadPort>> open_and_wait(const std::string& path);
  /// Waits until no device has a call in progress.
  void settle();

 private:
  struct Path;
  Path& at(const std::string& path);

  ClockPort& clock_;
  System& system_;
  UsbBuses buses_;
  std::map<std::string, std::unique_ptr<Path>> paths_;
};

}  // namespace nodal::hal::v4l2
