#pragma once

#include <atomic>
#include <functional>
#include <thread>
#include <vector>

#include "firmware/daemon/bell.h"
#include "firmware/rig.h"

namespace nodal::daemon {

/// The rig's threads: capture, encode, keeper, control, and `blend_threads` that blend. Each thread calls its stage until
/// there is no work. Then it sleeps until another thread rings its bell or, to poll devices and sockets, for a fixed time
/// (see threads.cpp).
///
/// Threading: start and stop on main.
/// Ownership: the rig outlives it.
/// Errors: the constructor throws std::system_error when the system refuses a thread; then none is left.
class RigThreads {
 public:
  struct Hooks {
    std::function<void(const std::string&)> log;  ///< called on the control thread with a sentence
    /// Called on the capture thread while the frame path is empty; may be empty.
    std::function<void()> idle_capture;
    std::function<void(const char*)> waits_for;  ///< called on main with the name of the thread that is joined next
  };

  RigThreads(firmware::Rig& rig, int blend_threads, Hooks hooks);
  /// Stops and joins.
  ~RigThreads();

 private:
  void start(int blend_threads);
  void stop();
  void capture();
  void blend();
  void encode();
  void keep();
  void control();
  bool frame_path_empty() const;

  firmware::Rig& rig_;
  const Hooks hooks_;
  std::atomic<bool> stop_{false};
  Bell capture_bell_, blend_bell_, encode_bell_, keeper_bell_, control_bell_;
  struct Named {
    const char* name;
    std::thread thread;
  };
  std::vector<Named> threads_;
};

}  // namespace nodal::daemon
