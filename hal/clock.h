#pragma once

#include "protocol/base/units.h"

namespace nodal::hal {

/// The rig's monotonic clock.
///
/// Threading: thread-safe.
/// Ownership: none.
/// Errors: none; it never goes backwards.
class ClockPort {
 public:
  virtual ~ClockPort() = default;
  virtual Instant now() = 0;
};

}  // namespace nodal::hal
