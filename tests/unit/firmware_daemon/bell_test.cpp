#include "firmware/daemon/bell.h"

#include <gtest/gtest.h>

#include <chrono>
#include <functional>
#include <thread>

#include "hal/linux/clock.h"

namespace nodal::daemon {
namespace {

/// The number of sleeps in this time of a thread that never finds work.
int sleeps_in(std::chrono::milliseconds time, PortBell& bell, hal::ClockPort& clock,
              const std::function<hal::WakeUps()>& ports) {
  int sleeps = 0;
  const Instant end = clock.now() + Duration::milliseconds(time.count());
  while (clock.now() < end) {
    const auto heard = bell.count();
    bell.wait(heard, ports());
    ++sleeps;
  }
  return sleeps;
}

hal::WakeUps at(Instant when) {
  hal::WakeUps wake_ups;
  wake_ups.at(when);
  return wake_ups;
}

class PortBellTest : public testing::Test {
 protected:
  hal::linux_os::LinuxClock clock_;
  PortBell bell_{clock_};
};

TEST_F(PortBellTest, RungWhileItSleeps_EndsTheSleep) {
  const auto heard = bell_.count();
  std::thread ringer([&] {
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
    bell_.ring();
  });
  while (bell_.count() == heard) bell_.wait(heard, hal::WakeUps());
  ringer.join();
  EXPECT_EQ(bell_.count(), heard + 1);
}

TEST_F(PortBellTest, RungBeforeItSleeps_DoesNotSleep) {
  const auto heard = bell_.count();
  bell_.ring();
  const Instant before = clock_.now();
  for (int i = 0; i < 1000; ++i) bell_.wait(heard, hal::WakeUps());
  EXPECT_LT(clock_.now() - before, Duration::seconds(1)) << "one sleep to its limit takes 0.1 s, so 1000 take 100 s";
}

TEST_F(PortBellTest, RungOnce_EndsOneSleepOnly) {
  const auto heard = bell_.count();
  std::thread ringer([&] {
    while (bell_.count() == heard) {
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
      bell_.ring();
    }
  });
  while (bell_.count() == heard) bell_.wait(heard, hal::WakeUps());
  ringer.join();
  const Instant when = clock_.now() + Duration::milliseconds(20);
  const auto after = bell_.count();
  bell_.wait(after, at(when));
  EXPECT_GE(clock_.now(), when);
}

TEST_F(PortBellTest, TimeOfAPort_EndsTheSleepThenAndNotBefore) {
  bool before_its_limit = false;  // its limit is 0.1 s; on a busy machine one sleep may be longer
  for (int i = 0; i < 20 && !before_its_limit; ++i) {
    const Instant when = clock_.now() + Duration::milliseconds(10);
    const auto heard = bell_.count();
    bell_.wait(heard, at(when));
    EXPECT_GE(clock_.now(), when);
    before_its_limit = clock_.now() < when + Duration::milliseconds(85);
  }
  EXPECT_TRUE(before_its_limit);
}

TEST_F(PortBellTest, DescriptorThatIsAlwaysReadable_IsPolledAndDoesNotSpin) {
  const int error = ::eventfd(1, EFD_NONBLOCK | EFD_CLOEXEC);
  const int sleeps = sleeps_in(std::chrono::milliseconds(200), bell_, clock_, [&] {
    hal::WakeUps wake_ups;
    wake_ups.on({error, true, false});
    return wake_ups;
  });
  EXPECT_LE(sleeps, 2 * 200 + 10);
  EXPECT_GE(sleeps, 4) << "its ports are looked at";
  ::close(error);
}

TEST_F(PortBellTest, TimeThatHasPassed_IsPolledAndDoesNotSpin) {
  const int sleeps = sleeps_in(std::chrono::milliseconds(200), bell_, clock_, [&] { return at(clock_.now()); });
  EXPECT_LE(sleeps, 2 * 200 + 10);
}

TEST_F(PortBellTest, DescriptorThatHadWork_EndsTheNextSleepToo) {
  const int data = ::eventfd(1, EFD_NONBLOCK | EFD_CLOEXEC);
  hal::WakeUps wake_ups;
  wake_ups.on({data, true, false});
  const Instant before = clock_.now();
  for (int i = 0; i < 1000; ++i) {
    const auto heard = bell_.count();
    bell_.wait(heard, wake_ups);
    bell_.worked();
  }
  EXPECT_LT(clock_.now() - before, Duration::milliseconds(900)) << "1000 polls would take 1 s";
  ::close(data);
}

}  // namespace
}  // namespace nodal::daemon
