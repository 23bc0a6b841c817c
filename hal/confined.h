#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "protocol/base/result.h"

namespace nodal::hal {

struct ConfinedJob {
  std::string what;  ///< subject of the work, such as the take "000042"
  std::vector<std::uint8_t> input{};
};

/// Does one kind of work on untrusted data in isolation: without access to the rig's memory, files, devices and hosts,
/// and with limits of memory and time, so that a failure affects nothing else. One job at a time; the caller polls its
/// result.
///
/// Threading: thread-bound to the stage that has the work.
/// Ownership: end() and the destructor end a running job.
/// Errors: kBusy from begin() while a job runs, kDeviceGone when no more jobs can be done until nodald starts again. As
///   a result: the work's own; kOverload if it needed more memory or time than it may have, kInternal if it crashed.
class ConfinedPort {
 public:
  virtual ~ConfinedPort() = default;
  virtual Status begin(ConfinedJob job) = 0;
  /// What the work returned, once. Nothing while it runs, and while no job was begun.
  virtual std::optional<Result<std::vector<std::uint8_t>>> take_result() = 0;
  /// A number that rises while the job makes progress.
  virtual std::uint64_t progress() const = 0;
  /// Ends the running job, if there is one; it has no result.
  virtual void end() = 0;
};

/// Reports progress: raises ConfinedPort::progress().
using ConfinedProgress = std::function<void()>;
/// What a port does with its jobs. It keeps no state between them.
using ConfinedWork = std::function<Result<std::vector<std::uint8_t>>(const ConfinedJob&, const ConfinedProgress&)>;

}  // namespace nodal::hal
