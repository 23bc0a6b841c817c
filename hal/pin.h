#pragma once

#include <cstdint>
#include <optional>

#include "protocol/base/result.h"
#include "protocol/base/units.h"

namespace nodal::hal {

struct PinEdge {
  Instant at;
  bool high = false;
};

/// One output line with a safe level, to which it returns when its lease expires, so that a program that died leaves no
/// output switched on.
///
/// Threading: thread-bound to its stage.
/// Ownership: none.
/// Errors: kDeviceGone is final.
class OutputPinPort {
 public:
  virtual ~OutputPinPort() = default;
  /// Drives the level until `now + lease`; then the safe level, unless it is set again.
  virtual Status set(bool high, Instant now, Duration lease) = 0;
  /// Lets the port apply expired leases; call it at least every few milliseconds.
  virtual Status step(Instant now) = 0;
  /// Sets the line to its safe level permanently, to end the program while the thread of this port hangs; set() and
  /// step() then return kDeviceGone. May be called on any thread, also during another call; returns at once and takes
  /// no lock.
  virtual void make_safe() noexcept = 0;
};

/// One input line, for example a button.
///
/// Threading: thread-bound to its stage.
/// Ownership: none.
/// Errors: kDeviceGone is final.
class InputPinPort {
 public:
  virtual ~InputPinPort() = default;
  virtual Result<bool> level() = 0;
  /// The oldest edge that has not been taken, or nothing.
  virtual Result<std::optional<PinEdge>> take_edge() = 0;
};

}  // namespace nodal::hal
