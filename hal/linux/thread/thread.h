// Threads with a heartbeat.
#pragma once

#include <functional>
#include <string>
#include <thread>

#include "hal/heartbeats.h"

namespace nodal::hal {

/// What a thread does after a piece of work.
enum class Round { kAgain, kSleep, kEnd };

/// A thread that does pieces of work and sleeps between them. Its heartbeat says since when it has been at the present
/// piece, so whoever writes the work cannot forget it.
///
/// Threading: the maker's; join() and detach() as of std::thread.
/// Ownership: what `work` refers to outlives the thread.
/// Errors: the constructor throws std::system_error when the system refuses a thread.
class Thread {
 public:
  using Work = std::function<Round()>;
  using Sleep = std::function<void()>;

  Thread() = default;
  /// `name`: at most 15 characters, as the kernel shows it; `of_what` follows it in the heartbeat's name. All signals
  /// are blocked on the thread, but those that report a crash: the others are for the program's main thread.
  Thread(const char* name, std::string of_what, Work work, Sleep sleep);
  Thread(const char* name, Work work, Sleep sleep) : Thread(name, "", std::move(work), std::move(sleep)) {}
  /// One piece of work.
  Thread(const char* name, std::string of_what, std::function<void()> once);
  /// Joins.
  ~Thread() {
    if (thread_.joinable()) thread_.join();
  }
  Thread(Thread&&) = default;
  Thread& operator=(Thread&&) = default;

  bool joinable() const { return thread_.joinable(); }
  void join() { thread_.join(); }
  void detach() { thread_.detach(); }
  std::thread::native_handle_type native_handle() { return thread_.native_handle(); }

 private:
  std::thread thread_;
};

/// The present piece of work of this thread goes on: its heartbeat begins again. Without effect on a thread that is no
/// Thread.
void beat();

/// All of this program's. Waits for nothing but the start and the end of a thread.
class Heartbeats final : public HeartbeatsPort {
 public:
  void read(std::vector<Heartbeat>& into) override;
};

}  // namespace nodal::hal
