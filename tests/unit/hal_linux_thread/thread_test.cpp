// Threads with a heartbeat: what others see of a thread that works, sleeps, goes on and ends.
#include "hal/linux/thread/thread.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <condition_variable>
#include <csignal>
#include <mutex>
#include <optional>

#include "tests/support/process.h"

namespace nodal::hal {
namespace {

using test::wait_until;

/// Busy time of the thread with this name; nothing if there is none.
std::optional<Duration> busy(const std::string& name) {
  Heartbeats heartbeats;
  std::vector<Heartbeat> all;
  heartbeats.read(all);
  const auto found = std::ranges::find(all, name, &Heartbeat::name);
  return found == all.end() ? std::nullopt : std::optional(found->busy);
}

/// How much longer the first thread has been busy than the second.
Duration apart(const std::string& first, const std::string& second) {
  Heartbeats heartbeats;
  std::vector<Heartbeat> all;
  heartbeats.read(all);
  return std::ranges::find(all, first, &Heartbeat::name)->busy - std::ranges::find(all, second, &Heartbeat::name)->busy;
}

/// A gate at which a thread waits.
class Gate {
 public:
  void open() {
    const std::lock_guard lock(mutex_);
    open_ = true;
    changed_.notify_all();
  }
  void wait() {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [this] { return open_; });
  }

 private:
  std::mutex mutex_;
  std::condition_variable changed_;
  bool open_ = false;
};

TEST(Thread, AtOnePieceOfWork_IsBusyForLongerAndLonger) {
  Gate gate;
  {
    const Thread thread("busy", "", [&] { gate.wait(); });
    ASSERT_TRUE(wait_until([] { return busy("busy").value_or(Duration()) > Duration::milliseconds(20); }));
    gate.open();
  }
  EXPECT_FALSE(busy("busy")) << "it has ended";
}

TEST(Thread, Asleep_IsNotBusyHoweverLong) {
  Gate gate;
  std::atomic<bool> sleeps{false};
  const Thread thread(
      "sleeper", [&] { return sleeps.load() ? Round::kEnd : Round::kSleep; },
      [&] {
        sleeps = true;
        gate.wait();
      });
  ASSERT_TRUE(wait_until([&] { return sleeps.load(); }));
  EXPECT_EQ(busy("sleeper"), Duration());
  gate.open();
}

TEST(Thread, ThatBeats_BeginsAgain) {
  Gate first, second;
  std::atomic<bool> beaten{false};
  const Thread silent("silent", "", [&] { second.wait(); });
  ASSERT_TRUE(wait_until([] { return busy("silent").value_or(Duration()) > Duration::milliseconds(50); }));
  const Thread thread("beater", "", [&] {
    first.wait();
    beat();
    beaten = true;
    second.wait();
  });
  ASSERT_TRUE(wait_until([] { return busy("beater").value_or(Duration()) > Duration::milliseconds(50); }));
  const Duration before = apart("silent", "beater");
  first.open();
  ASSERT_TRUE(wait_until([&] { return beaten.load(); }));
  EXPECT_GT(apart("silent", "beater"), before + Duration::milliseconds(49))
      << "50 ms and more of the beater do not count any more";
  second.open();
}

TEST(Thread, OfSomething_NamesItInItsHeartbeat) {
  Gate gate;
  const Thread thread("device", "v4l2:/dev/video2", [&] { gate.wait(); });
  EXPECT_TRUE(wait_until([] { return busy("device v4l2:/dev/video2").has_value(); }));
  gate.open();
}

TEST(Thread, Signals_AreForMainAndCrashesForTheThread) {
  sigset_t mask;
  sigemptyset(&mask);
  {
    const Thread thread("signals", "", [&] { pthread_sigmask(SIG_SETMASK, nullptr, &mask); });
  }
  for (const int signal : {SIGTERM, SIGHUP, SIGINT, SIGUSR1}) EXPECT_EQ(sigismember(&mask, signal), 1) << signal;
  for (const int signal : {SIGSEGV, SIGABRT, SIGBUS}) EXPECT_EQ(sigismember(&mask, signal), 0) << signal;
}

}  // namespace
}  // namespace nodal::hal
