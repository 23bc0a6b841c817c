#pragma once

#include <string_view>

namespace nodal::hal {

/// Tells whoever supervises the daemon that it is ready and makes progress.
///
/// Threading: thread-bound to the supervisor.
/// Ownership: none.
/// Errors: none; without a supervisor it does nothing.
class WatchdogPort {
 public:
  virtual ~WatchdogPort() = default;
  virtual void ready() = 0;
  virtual void feed() = 0;
  /// It ends on purpose; what is left takes a moment.
  virtual void stopping() = 0;
  /// One line; what follows a line break is left out.
  virtual void status(std::string_view line) = 0;
};

}  // namespace nodal::hal
