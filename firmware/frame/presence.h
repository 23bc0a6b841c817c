#pragma once

#include <atomic>
#include <memory>

#include "protocol/base/result.h"

namespace nodal::firmware {

/// Whether the host that made a request is still connected. Control ends it with the connection; a stage drops requests
/// of hosts that have gone before it begins them, so that they take no place in a queue from hosts that wait.
///
/// Threading: of_host() and end() are control's, gone() is for any thread.
/// Ownership: copies share one state.
/// Errors: none.
class Presence {
 public:
  /// The presence of the rig itself, for requests that it makes; it never ends.
  Presence() = default;
  static Presence of_host() {
    Presence presence;
    presence.gone_ = std::make_shared<std::atomic<bool>>(false);
    return presence;
  }

  void end() const {
    if (gone_) gone_->store(true, std::memory_order_release);
  }
  bool gone() const { return gone_ && gone_->load(std::memory_order_acquire); }

  /// The answer to a request that was dropped; the audit log has it, the host does not get it.
  static Error error() { return {Errc::kCancelled, "its host disconnected before its turn"}; }

 private:
  std::shared_ptr<std::atomic<bool>> gone_;
};

}  // namespace nodal::firmware
