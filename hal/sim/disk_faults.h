// What goes wrong with a simulated disk, and how long its operations take.
#pragma once

#include <cstdint>
#include <set>
#include <string>
#include <utility>

#include "hal/sim/clock.h"
#include "protocol/base/result.h"
#include "protocol/base/units.h"

namespace nodal::hal::sim {

/// A test plans the faults; the disk asks before each operation. An operation changes the disk: every call of create,
/// open_append, write, overwrite, truncate, sync, sync_all, rename, remove, make_folder and sync_folder.
///
/// Threading: thread-bound to the disk's stage.
/// Ownership: the clock outlives it.
/// Errors: those that the disk reports.
class DiskFaults {
 public:
  // What the test uses.
  /// Number of operations so far.
  std::uint64_t operations() const { return operations_; }
  /// The power fails during operation k (counted from 0): it is done completely, partly or not at all, and it and all
  /// later operations fail with kIo.
  void die_at(std::uint64_t operation) { die_at_ = operation; }
  bool dead() const { return dead_; }
  /// Operation k fails with kIo and changes nothing; other operations are not affected.
  void fail_at(std::uint64_t operation) { fail_at_.insert(operation); }
  /// Every operation takes this long on `clock`, which must be virtual.
  void be_slow(SimClock* clock, Duration each) {
    slow_clock_ = clock;
    slow_by_ = each;
  }
  /// Writing takes this long on `clock`, which must be virtual.
  void set_speed(SimClock* clock, std::uint64_t bytes_per_second) {
    slow_clock_ = clock;
    speed_ = bytes_per_second;
  }
  /// The next operation takes so long on `clock`, which must be virtual.
  void stall(SimClock* clock, Duration once) {
    slow_clock_ = clock;
    stall_ = once;
  }
  /// The next calls of read() and read_at() fail with kIo.
  void fail_reads(int count) { failing_reads_ = count; }
  /// Bytes of the file from `offset` on cannot be read: kIo. Empty: all can.
  void spoil(const std::string& name, std::uint64_t offset) { spoiled_ = {name, offset}; }
  /// Every operation fails with kIo from now on, or no longer.
  void be_read_only(bool on = true) { read_only_ = on; }
  /// All calls fail with kDeviceGone from now on, or no longer.
  void unplug(bool gone = true) { gone_ = gone; }
  /// The next calls of sync() or sync_all() fail with kIo, and their bytes are lost: later ones do not make them
  /// durable.
  void fail_syncs(int count) { failing_syncs_ = count; }

 protected:
  /// Whether the disk answers at all.
  Status answers(const std::string& name) const;
  /// Counts an operation, and applies the fault that is planned for it.
  Status begin(const char* what, const std::string& name);
  /// `end`: of the bytes that are read.
  Status begin_read(const std::string& name, std::uint64_t end);
  /// Whether this sync fails.
  bool sync_fails();
  /// Writing so many bytes takes its time.
  void write_for(std::uint64_t bytes);
  /// The power fails during the present operation.
  bool dying() const { return dying_; }

 private:
  std::uint64_t operations_ = 0;
  std::uint64_t die_at_ = ~std::uint64_t{0};
  bool dying_ = false;
  bool dead_ = false;
  std::set<std::uint64_t> fail_at_;
  SimClock* slow_clock_ = nullptr;
  Duration slow_by_;
  std::uint64_t speed_ = 0;  ///< bytes a second; 0: no limit
  bool gone_ = false;
  int failing_syncs_ = 0;
  int failing_reads_ = 0;
  std::pair<std::string, std::uint64_t> spoiled_;
  bool read_only_ = false;
  Duration stall_;
};

}  // namespace nodal::hal::sim
