// The runner's threads on the machine's own clock.
#include "hal/linux/gpio/runner.h"

#include <gtest/gtest.h>

#include <atomic>
#include <csignal>
#include <future>
#include <utility>

namespace nodal::hal::gpio {
namespace {

class RunnerTest : public testing::TestWithParam<bool> {};

TEST_P(RunnerTest, Step_IsCalledAtTheTimesThatItReturnsAndNeverBefore) {
  std::promise<void> done;
  Instant due;
  int calls = 0;
  std::atomic<bool> early{false};
  const Running running = run_on_thread({"test", GetParam()}, [&](Instant now) {
    if (now < due) early.store(true);
    if (++calls == 20) done.set_value();
    due = now + Duration::milliseconds(1);
    return calls < 20 ? due : kNever;
  });
  ASSERT_EQ(done.get_future().wait_for(std::chrono::seconds(30)), std::future_status::ready);
  EXPECT_FALSE(early.load());
}

TEST_P(RunnerTest, RungWhileItSleepsForEver_StepIsCalledAgain) {
  std::atomic<int> calls{0};
  const Running running = run_on_thread({"test", GetParam()}, [&](Instant) {
    ++calls;
    calls.notify_all();
    return kNever;
  });
  for (int i = 1; i < 100; ++i) {
    const int before = calls.load();
    running.runner->ring();
    if (calls.load() == before) calls.wait(before);
  }
  EXPECT_GE(calls.load(), 99);
}

TEST_P(RunnerTest, DestroyedWhileItSleeps_EndsAtOnce) {
  for (int i = 0; i < 50; ++i) run_on_thread({"test", GetParam()}, [](Instant) { return kNever; });
}

TEST_P(RunnerTest, Thread_TakesNoSignalsOfMain) {
  std::promise<bool> blocked;
  const Running running = run_on_thread({"test", GetParam()}, [&, notified = false](Instant) mutable {
    sigset_t mask;
    pthread_sigmask(SIG_SETMASK, nullptr, &mask);
    if (!std::exchange(notified, true))
      blocked.set_value(sigismember(&mask, SIGTERM) == 1 && sigismember(&mask, SIGINT) == 1);
    return kNever;
  });
  EXPECT_TRUE(blocked.get_future().get());
  sigset_t mask;
  pthread_sigmask(SIG_SETMASK, nullptr, &mask);
  EXPECT_EQ(sigismember(&mask, SIGTERM), 0) << "this thread's mask is as it was";
}

INSTANTIATE_TEST_SUITE_P(Both, RunnerTest, testing::Bool(),
                         [](const auto& realtime) { return realtime.param ? "Timed" : "Polled"; });

}  // namespace
}  // namespace nodal::hal::gpio
