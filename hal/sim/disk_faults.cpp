#include "hal/sim/disk_faults.h"

#include <fmt/format.h>

#include <utility>

#include "hal/sim/disk_inode.h"
#include "protocol/base/try.h"

namespace nodal::hal::sim {

Status DiskFaults::answers(const std::string& name) const {
  if (dead_) return fail(no_power(name));
  if (gone_) return fail(disk_gone(name));
  return {};
}

Status DiskFaults::begin(const char* what, const std::string& name) {
  NODAL_TRY(answers(name));
  const std::uint64_t operation = operations_++;
  if (slow_clock_ != nullptr) slow_clock_->advance(slow_by_ + std::exchange(stall_, Duration()));
  dying_ = operation == die_at_;
  if (dying_) dead_ = true;
  if (read_only_) return fail(Errc::kIo, fmt::format("file '{}': {} failed: the disk is read-only", name, what));
  if (fail_at_.contains(operation)) {
    return fail(Errc::kIo, fmt::format("file '{}': {} failed: the disk reports an error", name, what));
  }
  return {};
}

Status DiskFaults::begin_read(const std::string& name, std::uint64_t end) {
  NODAL_TRY(answers(name));
  const bool spoiled = name == spoiled_.first && end > spoiled_.second;
  if (failing_reads_ == 0 && !spoiled) return {};
  failing_reads_ -= failing_reads_ == 0 ? 0 : 1;
  return fail(Errc::kIo, fmt::format("file '{}': reading it failed: the disk reports an error", name));
}

bool DiskFaults::sync_fails() {
  if (failing_syncs_ == 0) return false;
  --failing_syncs_;
  return true;
}

void DiskFaults::write_for(std::uint64_t bytes) {
  if (speed_ == 0) return;
  slow_clock_->advance(Duration::nanoseconds(static_cast<std::int64_t>(bytes * 1'000'000'000 / speed_)));
}

}  // namespace nodal::hal::sim
