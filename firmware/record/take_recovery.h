// Which takes are recovered, one after the other, and what becomes of one that cannot be.
#pragma once

#include <algorithm>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "hal/confined.h"
#include "hal/disk.h"
#include "protocol/base/result.h"

namespace nodal::firmware {

/// Recovers the takes of a disk that nobody vouches for. Before each attempt the take's file kRecoveringFile says how
/// many were begun, also after a power cut. After kMaxAttempts that failed, the take gets the file kSetAsideFile with
/// the reason: it stays as it is, and no rig tries it again while the file is there. Failures of the disk do not count.
///
/// Threading: thread-bound to the disk's stage. With a port, the recovery runs beside the stage; without one, in
/// step().
/// Ownership: disk and port outlive it.
/// Errors: in Done.
class TakeRecovery {
 public:
  TakeRecovery(hal::DiskPort& disk, hal::ConfinedPort* confined) : disk_(disk), confined_(confined) {}

  enum class Outcome : std::uint8_t {
    kRecovered,
    kNothing,   ///< nothing had been recorded
    kFailed,    ///< it is tried again when nodald starts
    kSetAside,  ///< it is not tried again
  };
  struct Done {
    std::uint64_t take = 0;
    Outcome outcome = Outcome::kRecovered;
    std::string problem{};
  };

  /// The newest that was added is recovered first.
  void add(std::uint64_t take) { waiting_.push_back(take); }
  /// Whether takes are recovered while the stage goes on with other work.
  bool is_beside() const { return confined_ != nullptr; }
  /// No take waits or is being recovered.
  bool idle() const { return waiting_.empty() && !running_; }
  bool is_running(std::uint64_t take) const { return running_ && running_->take == take; }
  bool waits(std::uint64_t take) const { return std::ranges::find(waiting_, take) != waiting_.end(); }
  /// The take is deleted, or is recovered already. Not for the one that runs.
  void forget(std::uint64_t take) { std::erase(waiting_, take); }
  /// Forgets all that wait: their disk is no longer there.
  void forget_all() { waiting_.clear(); }

  /// Ends the running recovery when it is done; else begins the next one, if `begin`.
  std::optional<Done> step(bool begin);
  /// Recovers this take next. Nothing while it runs, or another one does.
  std::optional<Done> recover(std::uint64_t take);
  /// nodald ends: a running recovery is broken off and does not count.
  void close();

  static constexpr int kMaxAttempts = 2;

 private:
  struct Running {
    std::uint64_t take = 0;
    int attempts = 0;  ///< before this one
  };
  std::optional<Done> begin(std::uint64_t take);
  Done finish(const Running& run, const Result<std::vector<std::uint8_t>>& result);
  Done set_aside(std::uint64_t take, const std::string& why);
  int attempts_of(std::uint64_t take) const;
  void note_attempts(std::uint64_t take, int attempts);

  hal::DiskPort& disk_;
  hal::ConfinedPort* const confined_;
  std::vector<std::uint64_t> waiting_;
  std::optional<Running> running_;
};

/// Why a take was set aside; nothing if it was not.
std::optional<std::string> set_aside_reason(hal::DiskPort& disk, std::uint64_t take);

/// What a process of its own does for one take: recovers it in its folder, job.what. Errors: recover_take()'s.
Result<std::vector<std::uint8_t>> recovery_work(hal::DiskPort& disk, const std::string& folder,
                                                const std::function<void()>& progress);
/// Addresses, beside those of the program: the evidence of a segment and the manifest at their limits need less.
inline constexpr std::uint64_t kMaxRecoveryBytes = std::uint64_t{384} << 20;

}  // namespace nodal::firmware
