#pragma once

#include <sys/eventfd.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <mutex>
#include <optional>
#include <system_error>
#include <utility>

#include "hal/clock.h"
#include "hal/linux/link/wait.h"
#include "hal/wake_ups.h"

namespace nodal::daemon {

/// Wakes threads that sleep because they have no work. ring() takes a lock only if a thread sleeps, otherwise it is one
/// atomic addition, so that the frame path takes no lock.
///
///   const auto count = bell.count();     read before looking for work
///   if (!work()) bell.wait(count, ...);  returns at once if the bell rang after count()
///
/// Threading: thread-safe.
/// Ownership: none.
/// Errors: none.
class Bell {
 public:
  std::uint64_t count() const { return rung_.load(); }

  /// Wakes one of the threads that sleep; a thread that finds work for more rings again.
  void ring() {
    rung_.fetch_add(1);
    if (sleepers_.load() == 0) return;
    const std::lock_guard lock(mutex_);
    condition_.notify_one();
  }
  void ring_all() {
    rung_.fetch_add(1);
    const std::lock_guard lock(mutex_);
    condition_.notify_all();
  }

  void wait(std::uint64_t since, std::chrono::microseconds at_most) {
    sleepers_.fetch_add(1);
    {
      std::unique_lock lock(mutex_);
      condition_.wait_for(lock, at_most, [&] { return rung_.load() != since; });
    }
    sleepers_.fetch_sub(1);
  }

 private:
  std::atomic<std::uint64_t> rung_{0};
  std::atomic<int> sleepers_{0};
  std::mutex mutex_;
  std::condition_variable condition_;
};

/// Wakes one thread that also sleeps for its ports. count() and ring() as of Bell: ring() is a system call only while
/// the thread sleeps.
///
/// Threading: ring() and count() from any thread, wait() from one.
/// Ownership: owns a descriptor; the clock outlives it.
/// Errors: the constructor throws std::system_error when the system refuses the descriptor.
class PortBell {
 public:
  explicit PortBell(hal::ClockPort& clock) : clock_(clock), event_(::eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC)) {
    if (event_ < 0) throw std::system_error(errno, std::generic_category(), "eventfd");
  }
  ~PortBell() { ::close(event_); }
  PortBell(const PortBell&) = delete;
  PortBell& operator=(const PortBell&) = delete;

  std::uint64_t count() const { return rung_.load(); }

  void ring() {
    rung_.fetch_add(1);
    if (sleeps_.load()) ::eventfd_write(event_, 1);
  }

  /// Sleeps until it is rung or something of `ports` wakes the thread, at most kLongest; `ports` must have room for one
  /// more descriptor. Call it after the thread found no work.
  ///
  /// A port may wake the thread and then have nothing to do for it, again and again: a driver's error that lasts, or a
  /// time that has passed. The thread then polls its ports every kPoll, which uses little of a core.
  void wait(std::uint64_t since, const hal::WakeUps& ports) {
    const Instant now = clock_.now();
    const bool passed = ports.at() && *ports.at() <= now;
    const bool poll = std::exchange(by_port_, false) || passed;
    hal::WakeUps wake_ups = poll ? hal::WakeUps() : ports;
    std::optional<bool> written;  // stays empty if the thread does not sleep
    wake_ups.on({event_, true, false, &written});
    sleeps_.store(true);
    if (rung_.load() == since) {
      const bool by_descriptor = hal::wait_for(wake_ups, now, poll ? kPoll : kLongest);
      by_port_ = !poll && by_descriptor && rung_.load() == since;
    }
    sleeps_.store(false);
    if (!written.value_or(true)) return;
    eventfd_t rings = 0;
    ::eventfd_read(event_, &rings);
  }

  /// Call it after the thread found work.
  void worked() { by_port_ = false; }

 private:
  static constexpr Duration kLongest = Duration::milliseconds(100);
  static constexpr Duration kPoll = Duration::milliseconds(1);

  hal::ClockPort& clock_;
  const int event_;
  std::atomic<std::uint64_t> rung_{0};
  std::atomic<bool> sleeps_{false};
  bool by_port_ = false;  ///< a port's descriptor ended the newest sleep, and no work was found since
};

}  // namespace nodal::daemon
