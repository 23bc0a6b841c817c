// The end of nodald when a stage hangs: by force, with outputs at their safe levels.
#pragma once

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <functional>
#include <mutex>
#include <thread>

namespace nodal::daemon {

/// Between arm() and destruction a thread waits. When the time is over first, it makes outputs safe, says on standard
/// error what had not ended, and ends the process.
///
/// Threading: made, armed and destroyed on main; waits_for() from any thread.
/// Ownership: what protect() refers to lives until protect() is called again.
/// Errors: none.
class EndDeadline {
 public:
  EndDeadline() = default;
  /// The process ended in time.
  ~EndDeadline();
  EndDeadline(const EndDeadline&) = delete;
  EndDeadline& operator=(const EndDeadline&) = delete;

  /// What to call when the time is over: thread-safe, and returns at once. Empty: there are no outputs any more.
  void protect(std::function<void()> make_safe);
  /// Once.
  void arm(std::chrono::milliseconds at_most);
  /// What main waits for from now on; the string is never freed.
  void waits_for(const char* what) { what_.store(what); }
  /// Only the log's last lines are left to write: from now on the end is by this exit code, in time or not.
  void finished(int exit_code) { finished_.store(exit_code); }

 private:
  [[noreturn]] void end_by_force();

  std::mutex mutex_;
  std::condition_variable changed_;
  bool ended_ = false;
  std::function<void()> make_safe_;
  std::atomic<const char*> what_{"the rig"};
  std::atomic<int> finished_{-1};
  std::thread thread_;
};

}  // namespace nodal::daemon
