// A ConfinedPort whose work is done in a process of its own.
#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <memory>
#include <string>

#include "hal/confined.h"

namespace nodal::hal::linux_os {

struct ConfinedLimits {
  std::uint64_t memory_bytes = 0;             ///< addresses, beside those that the process has when it begins
  std::uint32_t cpu_seconds = 0;              ///< processor time of a job
  std::chrono::seconds without_progress{60};  ///< a job that counts no progress for so long is ended
  std::size_t result_bytes = 0;               ///< the most that a job may return
};

/// start() forks a helper while the process is small. For each job the helper forks a worker, which has the limits,
/// returns its result through memory of a fixed size, and ends. So a job cannot change what the next one sees. A worker
/// is the first to be ended by the kernel when the system has no more memory. Helper and worker end with the process.
///
/// Threading: thread-bound after start(). Ownership: ends the helper. Errors: as ConfinedPort; a sentence says which
/// limit.
class ConfinedProcess final : public ConfinedPort {
 public:
  /// `work` runs in the worker, which has one thread and no files but standard error. It restricts itself with
  /// confine() when it has opened what it needs. Call it before the process has threads that use what `work` uses, such
  /// as the log.
  /// Errors: kOverload if the system refuses a process.
  static Result<std::unique_ptr<ConfinedProcess>> start(const ConfinedLimits& limits, ConfinedWork work);
  ~ConfinedProcess() override;
  ConfinedProcess(const ConfinedProcess&) = delete;
  ConfinedProcess& operator=(const ConfinedProcess&) = delete;

  Status begin(ConfinedJob job) override;
  std::optional<Result<std::vector<std::uint8_t>>> take_result() override;
  std::uint64_t progress() const override { return shared_->load(std::memory_order_relaxed); }
  void end() override;

 private:
  using Shared = std::atomic<std::uint64_t>;
  ConfinedProcess(const ConfinedLimits& limits, int helper, Shared* shared)
      : limits_(limits), helper_(helper), shared_(shared) {}
  Result<std::vector<std::uint8_t>> result_of(int status, int memory) const;
  void watch();

  enum class State : std::uint8_t { kIdle, kRunning, kEnding };  // kEnding: its result is not wanted

  const ConfinedLimits limits_;
  const int helper_;      ///< a socket
  Shared* const shared_;  ///< one page: the progress
  State state_ = State::kIdle;
  bool gone_ = false, hung_ = false;
  std::uint64_t last_progress_ = 0;
  std::chrono::steady_clock::time_point progressed_;
};

}  // namespace nodal::hal::linux_os
