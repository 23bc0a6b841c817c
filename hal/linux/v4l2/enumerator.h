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

/// Paths are "v4l2:" and what open_device() knows a device by. Each path has a worker, which opens its device; so one
/// that takes long, or hangs, keeps no other from opening.
///
/// Threading: thread-bound to capture. The destructor waits for calls that are under way.
/// Ownership: the clock and the system outlive it; heads must be gone before it is.
/// Errors: open() is kNotReady while the first attempt at a path is under way, then what the newest attempt said while
///   the next is. kBusy when the path is open.
class V4l2Enumerator final : public HeadEnumerator {
 public:
  explicit V4l2Enumerator(ClockPort& clock, System& system = kernel());
  ~V4l2Enumerator() override;

  /// What the device at `path` is asked when it is opened. Starts the path's worker.
  void request(const std::string& path, const HeadRequest& request);

  Result<std::unique_ptr<HeadPort>> open(const std::string& path) override;
  /// Opens every device of the machine for a moment, which may take seconds: not for capture's thread.
  std::vector<HeadIdentity> list() override;

  /// As open(), but waits until the device has answered: for checks before anything runs.
  Result<std::unique_ptr<HeadPort>> open_and_wait(const std::string& path);
  /// Waits until no device has a call under way.
  void settle();

 private:
  struct Path;
  Path& at(const std::string& path);

  ClockPort& clock_;
  System& system_;
  std::map<std::string, std::unique_ptr<Path>> paths_;
};

}  // namespace nodal::hal::v4l2
