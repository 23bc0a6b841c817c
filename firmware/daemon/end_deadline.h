// Ends nodald by force, with outputs at their safe levels: when a stage hangs, when an exception leaves a thread's
// function, as std::bad_alloc does, and when nodald crashes.
#pragma once

#include <sys/types.h>

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <functional>
#include <mutex>
#include <optional>

#include "hal/linux/thread/thread.h"

namespace nodal::daemon {

/// A thread waits while outputs are protected. If the process has not ended within the time given to arm(), the thread
/// makes the outputs safe, prints on standard error which part hangs, and ends the process. The terminate handler does
/// the same at once: with exit code kExitFailed after std::bad_alloc, by abort() otherwise. So does the handler of
/// signals that report a crash (SignalOutcome::kCrashes), and lets the signal end the process; a stack overflow is not
/// handled. None of them allocates memory.
///
/// Threading: one object a process; made, armed and destroyed on main; waits_for() from any thread.
/// Ownership: what protect() refers to lives as long as its Protection.
/// Errors: protect() throws std::system_error when the system refuses a thread.
class EndDeadline {
 public:
  EndDeadline() = default;
  /// The process ended in time.
  ~EndDeadline();
  EndDeadline(const EndDeadline&) = delete;
  EndDeadline& operator=(const EndDeadline&) = delete;

  /// Outputs are protected for the lifetime of this object.
  class [[nodiscard]] Protection {
   public:
    explicit Protection(EndDeadline& deadline) : deadline_(deadline) {}
    ~Protection();
    Protection(const Protection&) = delete;
    Protection& operator=(const Protection&) = delete;

   private:
    EndDeadline& deadline_;
  };
  /// Call it once. `make_safe` must be thread-safe, return at once and allocate nothing.
  Protection protect(std::function<void()> make_safe);
  /// Starts the deadline. Call it once, after protect().
  void arm(std::chrono::milliseconds at_most);
  /// Names the part that main waits for now; the string must have static storage duration.
  void waits_for(const char* what) { what_.store(what); }
  /// Only the log's last lines are still to be written: after the deadline, the process ends with this exit code.
  void finished(int exit_code) { finished_.store(exit_code); }

 private:
  hal::Round look();
  void wait();
  [[noreturn]] void end_by_force();
  [[noreturn]] void end_by_exception();
  void end_by_crash(int signal);
  bool lock_soon();

  std::mutex mutex_;
  std::condition_variable changed_;
  bool ended_ = false;
  std::optional<std::chrono::steady_clock::time_point> until_;
  std::function<void()> make_safe_;
  std::atomic<const char*> what_{"the rig"};
  std::atomic<int> finished_{-1};
  std::atomic<pid_t> ends_by_exception_{0};  ///< the thread that does; 0: none
  hal::Thread thread_;
};

}  // namespace nodal::daemon
