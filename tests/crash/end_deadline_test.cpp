// The forced end, without a rig: what is called, which message is written, and the exit code.
#include "firmware/daemon/end_deadline.h"

#include <gtest/gtest.h>

#include <unistd.h>

#include <csignal>
#include <new>
#include <stdexcept>
#include <thread>

#include "protocol/base/result.h"

namespace nodal::daemon {
namespace {

using std::chrono::milliseconds;

void make_safe() { (void)!::write(STDERR_FILENO, "safe. ", 6); }

/// Runs `work` on a separate thread while outputs are protected.
[[noreturn]] void run_protected(void (*work)()) {
  EndDeadline deadline;
  const EndDeadline::Protection protection = deadline.protect(make_safe);
  std::thread([work] {
    pthread_setname_np(pthread_self(), "a-stage");
    work();
  }).join();
  ::_exit(77);
}

TEST(EndDeadline, RefusedMemory_IsTheEndWithOutputsSafe) {
  EXPECT_EXIT(run_protected([] { throw std::bad_alloc(); }), testing::ExitedWithCode(1),
              "safe\\. nodald: a-stage was refused memory");
}

TEST(EndDeadline, AnotherException_AbortsWithOutputsSafe) {
  EXPECT_EXIT(run_protected([] { throw std::runtime_error("nobody expects this"); }), testing::KilledBySignal(SIGABRT),
              "safe\\. nodald: exception in a-stage: nobody expects this");
}

TEST(EndDeadline, AFailedAssertion_AbortsWithOutputsSafe) {
  EXPECT_EXIT(run_protected([] { NODAL_ASSERT(2 < 1); }), testing::KilledBySignal(SIGABRT),
              "this must hold and does not: 2 < 1\nsafe\\. nodald: a check failed in a-stage");
}

TEST(EndDeadline, Crash_OutputsAreSafeAndTheSignalEndsTheProcess) {
  for (const int signal : {SIGSEGV, SIGBUS, SIGFPE, SIGILL, SIGTRAP, SIGSYS, SIGABRT}) {
    static int raised = 0;
    raised = signal;
    EXPECT_EXIT(run_protected([] { ::raise(raised); }), testing::KilledBySignal(signal),
                "safe\\. nodald: a-stage received SIG[A-Z]+; outputs are at their safe levels");
  }
}

TEST(EndDeadline, CrashWhileAnotherThreadSetsTheDeadline_OutputsAreSafeToo) {
  for (int i = 0; i < 10; ++i) {
    EXPECT_EXIT(
        {
          EndDeadline deadline;
          const EndDeadline::Protection protection = deadline.protect(make_safe);
          std::thread([&] {
            for (;;) deadline.arm(std::chrono::hours(1));
          }).detach();
          std::this_thread::sleep_for(milliseconds(1));
          ::raise(SIGSEGV);
        },
        testing::KilledBySignal(SIGSEGV), "safe\\. nodald: .* received SIGSEGV");
  }
}

TEST(EndDeadline, CrashWhileAnExceptionMakesTheOutputsSafe_TheyAreSafeFirst) {
  EXPECT_EXIT(
      {
        EndDeadline deadline;
        const EndDeadline::Protection protection = deadline.protect([] {
          std::this_thread::sleep_for(milliseconds(30));
          make_safe();
        });
        std::thread([] {
          pthread_setname_np(pthread_self(), "a-stage");
          throw std::runtime_error("nobody expects this");
        }).detach();
        std::this_thread::sleep_for(milliseconds(10));
        ::raise(SIGSEGV);
      },
      testing::KilledBySignal(SIGABRT), "safe\\. nodald: exception in a-stage: nobody expects this");
}

TEST(EndDeadline, NotEndedInTime_IsTheEndWithOutputsSafeAndSaysWhatHangs) {
  EXPECT_EXIT(
      {
        EndDeadline deadline;
        const EndDeadline::Protection protection = deadline.protect(make_safe);
        deadline.waits_for("a-stage");
        deadline.arm(milliseconds(20));
        for (;;) ::pause();
      },
      testing::ExitedWithCode(4), "safe\\. nodald: did not end in time, because a-stage hangs");
}

TEST(EndDeadline, OutputsThatAreClosed_AreNotTouchedAnyMore) {
  EXPECT_EXIT(
      {
        EndDeadline deadline;
        { const EndDeadline::Protection protection = deadline.protect(make_safe); }
        deadline.finished(0);
        deadline.arm(milliseconds(20));
        for (;;) ::pause();
      },
      testing::ExitedWithCode(0), "^$");
}

TEST(EndDeadline, EndedInTime_NothingIsDone) {
  int calls = 0;
  {
    EndDeadline deadline;
    const EndDeadline::Protection protection = deadline.protect([&] { ++calls; });
    deadline.arm(std::chrono::hours(1));
  }
  EXPECT_EQ(calls, 0);
}

}  // namespace
}  // namespace nodal::daemon
