// The end of nodald by force, with outputs at their safe levels: when a stage hangs, and when an exception reaches the
// end of a thread, as it does when memory is refused.
#pragma once

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <functional>
#include <mutex>
#include <optional>
#include <thread>

namespace nodal::daemon {

/// While outputs are protected, a thread waits. When the process has not ended so long after arm(), the thread makes the
/// outputs safe, says on standard error what had not ended, and ends the process. The terminate handler does the same at
/// once: for refused memory with exit code kExitFailed, for everything else by abort(). Neither allocates memory.
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

  /// Outputs are there for as long as this lives.
  class [[nodiscard]] Protection {
   public:
    explicit Protection(EndDeadline& deadline) : deadline_(deadline) {}
    ~Protection();
    Protection(const Protection&) = delete;
    Protection& operator=(const Protection&) = delete;

   private:
    EndDeadline& deadline_;
  };
  /// What makes them safe: thread-safe, returns at once, allocates nothing. Once.
  Protection protect(std::function<void()> make_safe);
  /// Once, after protect().
  void arm(std::chrono::milliseconds at_most);
  /// What main waits for from now on; the string is never freed.
  void waits_for(const char* what) { what_.store(what); }
  /// Only the log's last lines are left to write: from now on the end is by this exit code, in time or not.
  void finished(int exit_code) { finished_.store(exit_code); }

 private:
  void wait_for_the_end();
  [[noreturn]] void end_by_force();
  [[noreturn]] void end_by_exception();

  std::mutex mutex_;
  std::condition_variable changed_;
  bool ended_ = false;
  std::optional<std::chrono::steady_clock::time_point> until_;
  std::function<void()> make_safe_;
  std::atomic<const char*> what_{"the rig"};
  std::atomic<int> finished_{-1};
  std::thread thread_;
};

}  // namespace nodal::daemon
