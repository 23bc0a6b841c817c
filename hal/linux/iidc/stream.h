// The stream of an IIDC camera: its buffers, its trigger, and the transmission.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>

#include "hal/linux/iidc/camera.h"
#include "hal/linux/iidc/negotiation.h"

namespace nodal::hal::iidc {

/// Threading: one thread at a time. begin(), restart() and end() may take seconds; take() and give_back() never wait.
/// Ownership: owns the buffers; refers to the camera.
class Stream {
 public:
  Stream(Camera& camera, const Granted& granted) : camera_(camera), granted_(granted) {}
  ~Stream() { end(); }
  Stream(const Stream&) = delete;
  Stream& operator=(const Stream&) = delete;

  /// Makes the buffers, sets the trigger (nothing: free run), and lets the camera transmit.
  Status begin(int buffers, const std::optional<TriggerChoice>& trigger);
  /// Ends the transfers and begins new ones; lent buffers keep their content.
  Status restart();
  /// Also releases the buffers. Safe at any time.
  void end();

  std::size_t buffers() const { return source_ ? source_->buffers() : 0; }
  int take(RawFrame& frame) { return source_->take(frame); }
  int give_back(std::size_t slot) { return source_->give_back(slot); }
  void add_wake_ups(WakeUps& to) const { source_->add_wake_ups(to); }

 private:
  /// Transfers are queued before the camera transmits, so that the first one begins with a frame's first byte.
  Status transfer();

  Camera& camera_;
  const Granted& granted_;
  std::unique_ptr<FrameSource> source_;
};

}  // namespace nodal::hal::iidc
