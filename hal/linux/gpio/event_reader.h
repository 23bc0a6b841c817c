// An input line whose events are taken one after the other.
#pragma once

#include <array>
#include <cstddef>
#include <memory>
#include <optional>
#include <utility>

#include "hal/linux/gpio/system.h"
#include "protocol/base/result.h"

namespace nodal::hal::gpio {

/// Threading: thread-bound.
/// Ownership: owns the line; the system outlives it.
/// Errors: the line's, with its name; kUnsupported when the kernel's timestamps are not of CLOCK_MONOTONIC.
class EventReader {
 public:
  EventReader(System& system, LineName name, std::unique_ptr<Line> line)
      : system_(system), name_(std::move(name)), line_(std::move(line)) {}

  /// Discards the events so far, as many as the kernel keeps.
  Status discard();
  /// The oldest event; nothing when there is none.
  Result<std::optional<LineEvent>> next();
  int descriptor() const { return line_->descriptor(); }

 private:
  Result<std::size_t> read();

  System& system_;
  const LineName name_;
  const std::unique_ptr<Line> line_;
  std::array<LineEvent, kKernelQueue> events_;
  std::size_t taken_ = 0, left_ = 0;
};

}  // namespace nodal::hal::gpio
