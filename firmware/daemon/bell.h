#pragma once

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <mutex>

namespace nodal::daemon {

/// Wakes threads that sleep because they have no work. ring() takes a lock only if a thread sleeps, otherwise it is one
/// atomic addition, so that the frame path takes no lock.
///
///   const auto heard = bell.count();     read before looking for work
///   if (!work()) bell.wait(heard, ...);  returns at once if the bell rang after count()
///
/// Threading: thread-safe.
/// Ownership: none.
/// Errors: none.
class Bell {
 public:
  std::uint64_t count() const { return rung_.load(); }

  void ring() {
    rung_.fetch_add(1);
    if (sleepers_.load() == 0) return;
    const std::lock_guard lock(mutex_);
    condition_.notify_all();
  }

  void wait(std::uint64_t heard, std::chrono::microseconds at_most) {
    sleepers_.fetch_add(1);
    {
      std::unique_lock lock(mutex_);
      condition_.wait_for(lock, at_most, [&] { return rung_.load() != heard; });
    }
    sleepers_.fetch_sub(1);
  }

 private:
  std::atomic<std::uint64_t> rung_{0};
  std::atomic<int> sleepers_{0};
  std::mutex mutex_;
  std::condition_variable condition_;
};

}  // namespace nodal::daemon
