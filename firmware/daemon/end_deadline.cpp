#include "firmware/daemon/end_deadline.h"

#include <poll.h>
#include <pthread.h>
#include <unistd.h>

#include <algorithm>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <exception>
#include <new>
#include <utility>

#include "firmware/daemon/options.h"
#include "hal/linux/link/signals.h"

namespace nodal::daemon {
namespace {

EndDeadline* of_this_process = nullptr;  ///< the terminate handler takes no argument and finds the object here

/// Writes to standard error directly, because the log's thread may hang, and only if the write does not block.
void say(const char* line, int length) {
  constexpr int kPatienceMs = 100;
  pollfd out{STDERR_FILENO, POLLOUT, 0};
  if (length > 0 && ::poll(&out, 1, kPatienceMs) == 1) {
    (void)!::write(STDERR_FILENO, line, static_cast<std::size_t>(length));
  }
}

template <class... Values>
void say_line(const char* format, Values... values) {
  char line[512];
  const int length = std::snprintf(line, sizeof line, format, values...);
  say(line, std::min(length, static_cast<int>(sizeof line) - 1));
}

}  // namespace

EndDeadline::~EndDeadline() {
  if (!thread_.joinable()) return;
  {
    const std::lock_guard lock(mutex_);
    ended_ = true;
  }
  changed_.notify_one();
  thread_.join();
}

EndDeadline::Protection EndDeadline::protect(std::function<void()> make_safe) {
  // Starts the thread now and not in arm(), when the system may refuse to create one.
  thread_ = hal::Thread(
      "nodal-end", [this] { return look(); }, [this] { wait(); });
  {
    const std::lock_guard lock(mutex_);
    make_safe_ = std::move(make_safe);
  }
  of_this_process = this;
  std::set_terminate([] { of_this_process->end_by_exception(); });
  struct sigaction crash {};
  crash.sa_handler = [](int signal) { of_this_process->end_by_crash(signal); };
  crash.sa_flags = static_cast<int>(SA_RESETHAND);
  for (int signal = 1; signal < SIGRTMIN; ++signal) {
    struct sigaction now {};
    ::sigaction(signal, nullptr, &now);
    // Sanitizers have handlers of their own.
    const bool own = hal::outcome_of(signal) == hal::SignalOutcome::kCrashes && now.sa_handler == SIG_DFL;
    if (own) ::sigaction(signal, &crash, nullptr);
  }
  return Protection(*this);
}

EndDeadline::Protection::~Protection() {
  const std::lock_guard lock(deadline_.mutex_);
  deadline_.make_safe_ = {};
}

void EndDeadline::arm(std::chrono::milliseconds at_most) {
  {
    const std::lock_guard lock(mutex_);
    until_ = std::chrono::steady_clock::now() + at_most;
  }
  changed_.notify_one();
}

hal::Round EndDeadline::look() {
  const std::lock_guard lock(mutex_);
  if (ended_) return hal::Round::kEnd;
  if (until_ && std::chrono::steady_clock::now() >= *until_) end_by_force();
  return hal::Round::kSleep;
}

void EndDeadline::wait() {
  std::unique_lock lock(mutex_);
  if (until_) changed_.wait_until(lock, *until_, [this] { return ended_; });
  else changed_.wait(lock, [this] { return ended_ || until_; });
}

/// Called with the lock held, so that the ports that make_safe_ uses are not destroyed meanwhile.
void EndDeadline::end_by_force() {
  if (make_safe_) make_safe_();
  const int exit_code = finished_.load();
  if (exit_code >= 0) ::_exit(exit_code);
  say_line("nodald: did not end in time, because %s hangs; outputs are at their safe levels; ending by force\n",
           what_.load());
  ::_exit(kExitStageHung);
}

/// Tries to lock for a limited time, because a signal handler must not wait without an end: the deadline's thread holds
/// the lock for microseconds, but a thread whose make_safe_ hangs or has crashed holds it for ever.
bool EndDeadline::lock_soon() {
  constexpr int kTries = 100;
  for (int i = 0; i < kTries; ++i) {
    if (mutex_.try_lock()) return true;
    (void)::poll(nullptr, 0, 1);
  }
  return false;
}

/// A signal handler. After end_by_exception(), which calls abort(), all is done, and this thread holds the lock. A
/// crash of another thread meanwhile leaves end_by_exception() the time of lock_soon().
void EndDeadline::end_by_crash(int signal) {
  if (ends_by_exception_.load() != ::gettid() && lock_soon()) {
    if (make_safe_) make_safe_();
    char thread[16] = "a thread";
    (void)::pthread_getname_np(::pthread_self(), thread, sizeof thread);
    say_line("nodald: %s received SIG%s; outputs are at their safe levels\n", thread, ::sigabbrev_np(signal));
  }
  ::raise(signal);  // delivered when this handler returns, with the default action
}

/// Called on the thread that threw. The lock is never released, so that a second such thread waits for the end.
void EndDeadline::end_by_exception() {
  mutex_.lock();
  ends_by_exception_.store(::gettid());
  if (make_safe_) make_safe_();
  char thread[16] = "a thread";
  (void)::pthread_getname_np(::pthread_self(), thread, sizeof thread);
  try {
    if (std::current_exception()) throw;
    say_line("nodald: a check failed in %s; outputs are at their safe levels; aborting\n", thread);
  } catch (const std::bad_alloc&) {
    say_line(
        "nodald: %s was refused memory; outputs are at their safe levels; ending; raise the limits on addresses "
        "and memory (ulimit -v, MemoryMax=), or make the raymap in rig.toml smaller\n",
        thread);
    ::_exit(kExitFailed);
  } catch (const std::exception& error) {
    say_line("nodald: exception in %s: %s; outputs are at their safe levels; aborting\n", thread, error.what());
  } catch (...) {
    say_line("nodald: exception in %s; outputs are at their safe levels; aborting\n", thread);
  }
  std::abort();
}

}  // namespace nodal::daemon
