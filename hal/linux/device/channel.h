// An open device that is set up, shared by its head and by the jobs that its worker still has.
#pragma once

#include <sys/eventfd.h>
#include <unistd.h>

#include <cstdint>
#include <mutex>
#include <optional>
#include <vector>

#include "hal/head.h"
#include "hal/linux/device/controls.h"

namespace nodal::hal::device {

/// Threading: set(), read() and end() are for jobs of the worker only; reports go from the worker to the head.
class Channel {
 public:
  Channel() : reported(::eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC)) {}
  virtual ~Channel() {
    if (reported >= 0) ::close(reported);
  }
  Channel(const Channel&) = delete;
  Channel& operator=(const Channel&) = delete;

  virtual const HeadFormat& format() const = 0;
  virtual const HeadLimits& limits() const = 0;
  /// At the time of opening.
  virtual const HeadSettings& settings() const = 0;
  /// Whether the device is gone, as far as the system tells without waiting.
  virtual bool gone() const = 0;

  // These may take seconds.
  virtual Status set(const ControlChange& change) = 0;
  virtual Result<HeadSettings> read() = 0;
  /// Stops the stream and releases its buffers. Safe at any time.
  virtual void end() = 0;

  /// The result of a worker's job.
  struct Report {
    enum class About : std::uint8_t { kStream, kControls } about = About::kStream;
    std::uint64_t start = 0;  ///< kStream: the start that it belongs to
    Instant at;               ///< when the calls returned
    std::optional<Error> error;
    HeadSettings settings;  ///< kControls
  };
  void report(Report&& report) {
    const std::lock_guard lock(mutex);
    reports.push_back(std::move(report));
    if (reported >= 0) ::eventfd_write(reported, 1);
  }

  const int reported;            ///< an eventfd, readable while there are reports; -1 if the system refused it
  std::mutex mutex;              ///< protects the following members
  std::vector<Report> reports;   ///< from the worker to the head
  ControlChange wanted;          ///< from the head to the worker: settings to apply
  bool controls_posted = false;  ///< a job that applies `wanted` is queued
};

}  // namespace nodal::hal::device
