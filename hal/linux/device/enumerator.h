// Opens devices whose opening takes long, each on a worker thread of its own.
#pragma once

#include <functional>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "hal/clock.h"
#include "hal/head.h"
#include "hal/linux/device/channel.h"
#include "hal/linux/device/worker.h"

namespace nodal::hal::device {

/// A path is a scheme, such as "v4l2:", and a name. Each path has a worker thread that opens its device, so a device
/// that is slow or hangs does not delay the others.
///
/// Threading: thread-bound to capture. The destructor waits for calls in progress.
/// Ownership: refers to the clock; destroy heads first.
/// Errors: open() returns kNotReady during the first attempt at a path; during later attempts it returns the result of
///   the last one. kBusy if the path is open.
class DeviceEnumerator : public HeadEnumerator {
 public:
  ~DeviceEnumerator() override;

  Result<std::unique_ptr<HeadPort>> open(const std::string& path) final;
  /// Like open(), but waits until the device has answered: for checks before the rig runs.
  Result<std::unique_ptr<HeadPort>> open_and_wait(const std::string& path);
  /// Waits until no device has a call in progress.
  void settle();

 protected:
  using Opened = Result<std::shared_ptr<Channel>>;
  /// An attempt to open a device. It runs on the worker, also after the enumerator, so it refers to nothing of it.
  using Attempt = std::function<Opened()>;

  /// `kind` is for messages, such as "a V4L2 head's".
  DeviceEnumerator(ClockPort& clock, std::string scheme, std::string kind);
  /// What the path requests from its device, for the next attempt. Starts the path's worker.
  void set_attempt(const std::string& path, Attempt attempt);
  virtual std::unique_ptr<HeadPort> make_head(const std::string& path, std::shared_ptr<Channel> channel, Worker& worker,
                                              ClockPort& clock, std::shared_ptr<bool> in_use) = 0;
  /// The attempt for a path without set_attempt().
  virtual Attempt usual_attempt(const std::string& path) = 0;

 private:
  struct Path;
  Path& at(const std::string& path);

  ClockPort& clock_;
  const std::string scheme_, kind_;
  std::map<std::string, std::unique_ptr<Path>> paths_;
};

}  // namespace nodal::hal::device
