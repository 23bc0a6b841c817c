// Lists IIDC cameras within a time.
#pragma once

#include <chrono>
#include <memory>
#include <vector>

#include "hal/linux/iidc/bus.h"
#include "protocol/base/result.h"

namespace nodal::hal::iidc {

/// Threading: list() on one thread at a time.
/// Ownership: a thread ends when the bus answers, so `bus` must live that long; the Lister need not.
class Lister {
 public:
  explicit Lister(Bus& bus);
  /// Asks on a thread of its own, because a bus that hangs is never waited for. kTimeout: it has not answered after
  /// `patience`; it is not asked again until it has, so that it occupies one thread. kOverload: the system refuses a
  /// thread.
  Result<std::vector<CameraInfo>> list(std::chrono::milliseconds patience);

 private:
  struct Answer;
  Bus& bus_;
  std::shared_ptr<Answer> answer_;
};

}  // namespace nodal::hal::iidc
