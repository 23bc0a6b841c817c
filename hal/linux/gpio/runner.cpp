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
#include <csignal>
#include <cstring>
#include <ctime>
#include <system_error>
#include <thread>
#include <utility>

namespace nodal::hal::gpio {
namespace {

/// Below the priority of the kernel's interrupt threads (50).
constexpr int kPriority = 40;

timespec timespec_of(std::int64_t ns) { return {static_cast<time_t>(ns / 1'000'000'000), ns % 1'000'000'000}; }

/// While it exists, threads are created with all signals blocked, so that none of them takes a signal meant for main.
class SignalsBlocked {
 public:
  SignalsBlocked() {
    sigset_t all;
    sigfillset(&all);
    pthread_sigmask(SIG_SETMASK, &all, &before_);
  }
  ~SignalsBlocked() { pthread_sigmask(SIG_SETMASK, &before_, nullptr); }
  SignalsBlocked(const SignalsBlocked&) = delete;
  SignalsBlocked& operator=(const SignalsBlocked&) = delete;

 private:
  sigset_t before_;
};

/// Sleeps to absolute times of CLOCK_MONOTONIC. FUTEX_WAIT_BITSET uses the same timer of the kernel as
/// clock_nanosleep(TIMER_ABSTIME), and ring() can end it early.
class TimedRunner final : public Runner {
 public:
  TimedRunner(const char* name, Step step) : step_(std::move(step)), thread_([this] { run(); }) {
    pthread_setname_np(thread_.native_handle(), name);
  }
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
  void run() {
    for (;;) {
      const std::uint32_t heard = rung_.load();
      if (stop_.load()) return;
      const Instant next = step_(monotonic_now());
      const timespec until = timespec_of(next.ns());
      ::syscall(SYS_futex, &rung_, FUTEX_WAIT_BITSET_PRIVATE, heard, next == kNever ? nullptr : &until, nullptr,
                FUTEX_BITSET_MATCH_ANY);
    }
  }

  const Step step_;
  std::atomic<std::uint32_t> rung_{0};
  static_assert(sizeof(std::atomic<std::uint32_t>) == sizeof(std::uint32_t), "the kernel reads it as a futex");
  std::atomic<bool> stop_{false};
  std::thread thread_;
};

/// Sleeps in poll() until a line has events, a time has come, or it is rung.
class PollRunner final : public Runner {
 public:
  PollRunner(const RunOptions& options, Step step) : step_(std::move(step)) {
    if (bell_ < 0) throw std::system_error(errno, std::generic_category(), "eventfd");
    waits_.push_back({bell_, POLLIN, 0});
    for (const Line* line : options.wake_on) waits_.push_back({line->descriptor(), POLLIN, 0});
    try {
      thread_ = std::thread([this] { run(); });
    } catch (...) {
      ::close(bell_);
      throw;
    }
    pthread_setname_np(thread_.native_handle(), options.name);
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
  void run() {
    while (!stop_.load()) {
      const Instant now = monotonic_now();
      const Instant next = step_(now);
      const timespec at_most = timespec_of(std::max<std::int64_t>((next - now).ns(), 0));
      ::ppoll(waits_.data(), waits_.size(), next == kNever ? nullptr : &at_most, nullptr);
      for (std::size_t i = 1; i < waits_.size(); ++i) {
        if ((waits_[i].revents & (POLLERR | POLLHUP | POLLNVAL)) != 0) waits_[i].fd = -1;  // would wake without end
      }
      std::uint64_t rung = 0;
      if ((waits_[0].revents & POLLIN) != 0) (void)!::read(bell_, &rung, sizeof rung);
    }
  }

  const Step step_;
  const int bell_ = ::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK);
  std::vector<pollfd> waits_;
  std::atomic<bool> stop_{false};
  std::thread thread_;
};

}  // namespace

Instant monotonic_now() {
  timespec now{};
  ::clock_gettime(CLOCK_MONOTONIC, &now);
  return Instant::from_ns(static_cast<std::int64_t>(now.tv_sec) * 1'000'000'000 + now.tv_nsec);
}

Running run_on_thread(const RunOptions& options, Step step) {
  const SignalsBlocked blocked;
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
