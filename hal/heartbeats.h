#pragma once

#include <string>
#include <vector>

#include "protocol/base/units.h"

namespace nodal::hal {

/// A thread, as the supervisor sees it.
struct Heartbeat {
  std::string name;  ///< "nodal-takes"; "nodal-device v4l2:/dev/video0"
  Duration busy;     ///< since it began its present piece of work, or last said that it goes on; 0: it sleeps
};

/// The heartbeats of all threads of the program.
///
/// Threading: any thread.
/// Ownership: none.
/// Errors: none.
class HeartbeatsPort {
 public:
  virtual ~HeartbeatsPort() = default;
  virtual void read(std::vector<Heartbeat>& into) = 0;
};

}  // namespace nodal::hal
