#pragma once

#include <atomic>
#include <functional>
#include <vector>

#include "firmware/daemon/bell.h"
#include "firmware/rig.h"
#include "hal/linux/thread/thread.h"

namespace nodal::daemon {

/// The rig's threads: capture, encode, keeper, control, `blend_threads` that blend; in a rig that places seams one
/// more, of low priority; and in a rig that records three more, for copying the pictures, for writing and for reading
/// takes. Each thread calls its stage until there is no work. Then it sleeps until another thread rings its bell;
/// capture and control also until one of their ports wakes them.
///
/// Threading: start and stop on main.
/// Ownership: the rig outlives it.
/// Errors: the constructor throws std::system_error when the system refuses a thread or a bell; then no thread is left.
class RigThreads {
 public:
  struct Hooks {
    std::function<void(const std::string&)> log;  ///< called on the control thread with a sentence
    /// Advances virtual time; empty when time is real. Called on the capture thread while the frame path is empty, with
    /// the time of its next event.
    std::function<void(Instant)> advance;
    std::function<void(const char*)> waits_for;  ///< called on main with the name of the thread that is joined next
  };

  /// The clock is the rig's.
  RigThreads(firmware::Rig& rig, hal::ClockPort& clock, int blend_threads, Hooks hooks);
  /// Stops and joins.
  ~RigThreads();

 private:
  void start(int blend_threads);
  void stop();
  void add_capture();
  void add_blend();
  void add_encode();
  void add_seams();
  void add_keeper();
  void add_takes();
  void add_control();
  template <class AnyBell, class Step, class Sleep>
  void add(const char* name, AnyBell& bell, Step step, Sleep sleep);
  template <class Step>
  void add(const char* name, Bell& bell, Step step);
  bool frame_path_empty() const;

  firmware::Rig& rig_;
  const Hooks hooks_;
  std::atomic<bool> stop_{false};
  PortBell capture_bell_, control_bell_;
  Bell blend_bell_, encode_bell_, seams_bell_, keeper_bell_, record_bell_, takes_bell_, read_bell_;
  struct Named {
    const char* name;
    hal::Thread thread;
  };
  std::vector<Named> threads_;
};

}  // namespace nodal::daemon
