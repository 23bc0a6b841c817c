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

/// One output line with a safe level, to which it returns when the lease runs out: a program that died leaves no
/// output on.
///
/// Threading: thread-bound to its stage.
/// Ownership: none.
/// Errors: kDeviceGone is final.
class OutputPinPort {
 public:
  virtual ~OutputPinPort() = default;
  /// Drives the level until `now + lease`, then the safe level unless set again.
  virtual Status set(bool high, Instant now, Duration lease) = 0;
  /// Lets the port act on leases; call at least every few milliseconds.
  virtual Status step(Instant now) = 0;
  /// For a program that must end while the thread this port is bound to hangs: the line goes to its safe level and stays
  /// there; set() and step() are kDeviceGone from then on. Any thread, also while another call is under way; returns at
  /// once and waits for no lock.
  virtual void make_safe() noexcept = 0;
};

/// One input line, such as a button.
///
/// Threading: thread-bound to its stage.
/// Ownership: none.
/// Errors: kDeviceGone is final.
class InputPinPort {
 public:
  virtual ~InputPinPort() = default;
  virtual Result<bool> level() = 0;
  /// The next edge not yet taken, oldest first, or nothing.
  virtual Result<std::optional<PinEdge>> take_edge() = 0;
};

}  // namespace nodal::hal
