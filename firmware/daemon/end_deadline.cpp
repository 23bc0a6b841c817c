#include "firmware/daemon/end_deadline.h"

#include <poll.h>
#include <pthread.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <new>
#include <utility>

#include "firmware/daemon/options.h"

namespace nodal::daemon {
namespace {

EndDeadline* of_this_process = nullptr;  ///< for the terminate handler, which takes no argument

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
  thread_ = std::thread([this] { wait_for_the_end(); });
  {
    const std::lock_guard lock(mutex_);
    make_safe_ = std::move(make_safe);
  }
  of_this_process = this;
  std::set_terminate([] { of_this_process->end_by_exception(); });
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

void EndDeadline::wait_for_the_end() {
  std::unique_lock lock(mutex_);
  changed_.wait(lock, [this] { return ended_ || until_; });
  if (ended_ || changed_.wait_until(lock, *until_, [this] { return ended_; })) return;
  end_by_force();
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

/// Called on the thread that threw. The lock is never released, so that a second such thread waits for the end.
void EndDeadline::end_by_exception() {
  mutex_.lock();
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
