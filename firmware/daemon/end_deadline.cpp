#include "firmware/daemon/end_deadline.h"

#include <poll.h>
#include <unistd.h>

#include <cstdio>
#include <utility>

#include "firmware/daemon/options.h"

namespace nodal::daemon {

EndDeadline::~EndDeadline() {
  if (!thread_.joinable()) return;
  {
    const std::lock_guard lock(mutex_);
    ended_ = true;
  }
  changed_.notify_one();
  thread_.join();
}

void EndDeadline::protect(std::function<void()> make_safe) {
  const std::lock_guard lock(mutex_);
  make_safe_ = std::move(make_safe);
}

void EndDeadline::arm(std::chrono::milliseconds at_most) {
  thread_ = std::thread([this, at_most] {
    std::unique_lock lock(mutex_);
    if (!changed_.wait_for(lock, at_most, [this] { return ended_; })) end_by_force();
  });
}

/// With the lock held, so that what is made safe stays alive meanwhile.
void EndDeadline::end_by_force() {
  if (make_safe_) make_safe_();
  const int exit_code = finished_.load();
  if (exit_code >= 0) ::_exit(exit_code);
  // Past the log, whose thread may be what hangs, and only when somebody reads.
  char line[256];
  const int length = std::snprintf(line, sizeof line,
                                   "nodald: did not end in time, since %s hangs; outputs are at their safe levels, and "
                                   "it ends by force\n", what_.load());
  constexpr int kPatienceMs = 100;
  pollfd out{STDERR_FILENO, POLLOUT, 0};
  if (::poll(&out, 1, kPatienceMs) == 1) (void)!::write(STDERR_FILENO, line, static_cast<std::size_t>(length));
  ::_exit(kExitStageHung);
}

}  // namespace nodal::daemon
