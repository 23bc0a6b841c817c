#pragma once

#include <string_view>

namespace nodal::hal {

/// Reports to the daemon's supervisor (systemd) that it is ready and makes progress.
///
/// Threading: thread-bound to the supervisor.
/// Ownership: none.
/// Errors: none; without a supervisor it does nothing.
class WatchdogPort {
 public:
  virtual ~WatchdogPort() = default;
  virtual void ready() = 0;
  virtual void feed() = 0;
  /// The daemon is shutting down on request.
  virtual void stopping() = 0;
  /// One line; text after a line break is left out.
  virtual void status(std::string_view line) = 0;
};

}  // namespace nodal::hal
