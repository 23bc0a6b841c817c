// A thread for a device's slow calls.
#pragma once

#include <condition_variable>
#include <deque>
#include <functional>
#include <mutex>
#include <string>

#include "hal/linux/thread/thread.h"

namespace nodal::hal::device {

/// Threading: thread-safe. Jobs run one at a time, in the order of post().
/// Errors: the constructor throws std::system_error if the system refuses a thread.
class Worker {
 public:
  /// `of_what`: for its heartbeat's name.
  explicit Worker(std::string of_what);
  /// Waits for all posted jobs.
  ~Worker();

  void post(std::function<void()> job);
  /// Whether no job is running or queued.
  bool idle() const;
  /// Waits until idle().
  void settle();

 private:
  Round work();
  void wait();

  mutable std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<std::function<void()>> jobs_;
  bool working_ = false;
  bool stop_ = false;
  Thread thread_;
};

}  // namespace nodal::hal::device
