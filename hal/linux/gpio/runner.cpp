#include "hal/linux/gpio/runner.h"

#include <linux/futex.h>
#include <poll.h>
#include <pthread.h>
#include <sched.h>
#include <sys/eventfd.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <cstring>
#include <ctime>
#include <system_error>
#include <utility>

#include "hal/linux/thread/thread.h"

namespace nodal::hal::gpio {
namespace {

/// Below the priority of the kernel's interrupt threads (50).
constexpr int kPriority = 40;

timespec timespec_of(std::int64_t ns) { return {static_cast<time_t>(ns / 1'000'000'000), ns % 1'000'000'000}; }

/// Sleeps to absolute times of CLOCK_MONOTONIC. FUTEX_WAIT_BITSET uses the same timer of the kernel as
/// clock_nanosleep(TIMER_ABSTIME), and ring() can end it early.
class TimedRunner final : public Runner {
 public:
  TimedRunner(const char* name, Step step)
      : step_(std::move(step)),
        thread_(
            name, [this] { return work(); }, [this] { sleep(); }) {}
  ~TimedRunner() override {
    stop_.store(true);
    ring();
    thread_.join();
  }
  void ring() override {
    rung_.fetch_add(1);
    ::syscall(SYS_futex, &rung_, FUTEX_WAKE_PRIVATE, 1, nullptr, nullptr, 0);
  }
  /// 0 or an errno.
  int make_realtime() {
    const sched_param priority{kPriority};
    return pthread_setschedparam(thread_.native_handle(), SCHED_FIFO, &priority);
  }

 private:
  Round work() {
    rings_ = rung_.load();
    if (stop_.load()) return Round::kEnd;
    next_ = step_(monotonic_now());
    return Round::kSleep;
  }
  void sleep() {
    const timespec until = timespec_of(next_.ns());
    ::syscall(SYS_futex, &rung_, FUTEX_WAIT_BITSET_PRIVATE, rings_, next_ == kNever ? nullptr : &until, nullptr,
              FUTEX_BITSET_MATCH_ANY);
  }

  const Step step_;
  std::atomic<std::uint32_t> rung_{0};
  static_assert(sizeof(std::atomic<std::uint32_t>) == sizeof(std::uint32_t), "the kernel reads it as a futex");
  std::atomic<bool> stop_{false};
  std::uint32_t rings_ = 0;  ///< the thread's, before the newest step
  Instant next_;             ///< the thread's
  Thread thread_;
};

/// Sleeps in poll() until a line has events, a time has come, or it is rung.
class PollRunner final : public Runner {
 public:
  PollRunner(const RunOptions& options, Step step) : step_(std::move(step)) {
    if (bell_ < 0) throw std::system_error(errno, std::generic_category(), "eventfd");
    waits_.push_back({bell_, POLLIN, 0});
    for (const Line* line : options.wake_on) waits_.push_back({line->descriptor(), POLLIN, 0});
    try {
      thread_ = Thread(
          options.name, [this] { return work(); }, [this] { sleep(); });
    } catch (...) {
      ::close(bell_);
      throw;
    }
  }
  ~PollRunner() override {
    stop_.store(true);
    ring();
    thread_.join();
    ::close(bell_);
  }
  void ring() override {
    const std::uint64_t one = 1;
    (void)!::write(bell_, &one, sizeof one);
  }

 private:
  Round work() {
    if (stop_.load()) return Round::kEnd;
    next_ = step_(monotonic_now());
    return Round::kSleep;
  }
  void sleep() {
    const timespec at_most = timespec_of(std::max<std::int64_t>((next_ - monotonic_now()).ns(), 0));
    ::ppoll(waits_.data(), waits_.size(), next_ == kNever ? nullptr : &at_most, nullptr);
    for (std::size_t i = 1; i < waits_.size(); ++i) {
      if ((waits_[i].revents & (POLLERR | POLLHUP | POLLNVAL)) != 0) waits_[i].fd = -1;  // would wake without end
    }
    std::uint64_t rung = 0;
    if ((waits_[0].revents & POLLIN) != 0) (void)!::read(bell_, &rung, sizeof rung);
  }

  const Step step_;
  const int bell_ = ::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK);
  std::vector<pollfd> waits_;
  std::atomic<bool> stop_{false};
  Instant next_;  ///< the thread's
  Thread thread_;
};

}  // namespace

Instant monotonic_now() {
  timespec now{};
  ::clock_gettime(CLOCK_MONOTONIC, &now);
  return Instant::from_ns(static_cast<std::int64_t>(now.tv_sec) * 1'000'000'000 + now.tv_nsec);
}

Running run_on_thread(const RunOptions& options, Step step) {
  if (!options.realtime) return {std::make_unique<PollRunner>(options, std::move(step)), {}};
  auto runner = std::make_unique<TimedRunner>(options.name, std::move(step));
  std::string notice;
  if (const int error = runner->make_realtime(); error != 0) {
    notice = "the trigger's thread has no real-time priority (SCHED_FIFO: " + std::string(std::strerror(error)) +
             "), so pulses may come late; permit it as firmware/daemon/nodald.service describes (LimitRTPRIO=)";
  }
  return {std::move(runner), std::move(notice)};
}

}  // namespace nodal::hal::gpio
