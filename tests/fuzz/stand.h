// A whole small rig in virtual time, and the rules that must hold for any hosts, disk and clock.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "firmware/rig.h"
#include "hal/sim/disk.h"
#include "hal/sim/watchdog.h"
#include "tests/fuzz/guest.h"
#include "tests/sim/world.h"

namespace nodal::fuzz {

/// Writes a file as another program would; a name that the disk refuses changes nothing.
void write_file(hal::sim::SimDisk& disk, const std::string& name, std::span<const std::uint8_t> bytes);

/// Two heads of 16 x 16 pixels at ten frames per second, a raymap of 16 x 8, the swarm's world. A broken rule below
/// aborts the program, which the fuzzer detects.
///
/// Threading: thread-bound.
/// Ownership: owns the world, the disk, the rig and its hosts.
/// Errors: none.
class Stand {
 public:
  // The rules.
  /// Live heap: 1.5 times the steady rig's, plus this. Connected hosts may have messages, uploads and raymaps in
  /// progress; after all have left, only their uploads and stored data remain.
  static constexpr std::int64_t kInFlightBytes = 24 << 20, kLeftBehindBytes = 192 << 10;
  /// A repeated request adds a record to the audit log, with three texts of up to 240 bytes.
  static constexpr unsigned kRepeats = 16;
  static constexpr std::int64_t kRepeatedBytes = kRepeats * 1280;
  static constexpr Duration kReplyWithin = Duration::seconds(1);
  /// The log: bytes in a burst after a start, bytes per second, bytes that a line adds to its sentence, maximum
  /// sentence length. No sentence has control characters, with which a host could forge a line or control a terminal.
  static constexpr std::int64_t kLogBytesAtOnce = 28 << 10, kLogBytesASecond = 600, kLineBytes = 40;
  static constexpr std::size_t kSentenceBytes = 600;
  /// The maximum number of pulses, exposures and frames per virtual second, and at one time; beyond, virtual time no
  /// longer advances.
  static constexpr std::int64_t kEventsASecond = 6000, kEventsAtOnce = 200;
  static constexpr int kTurnsToRest = 20'000;

  explicit Stand(std::unique_ptr<hal::sim::SimDisk> disk);
  ~Stand();

  /// A disk with the first of calibrations() in force.
  static std::unique_ptr<hal::sim::SimDisk> new_disk();
  static const std::array<Calibration, swarm::kCalibrations>& calibrations();
  static const firmware::RigConfig& config();

  // What the fuzzer uses.
  void settle();
  /// Advances the world; when the input's limit of events is used up, the clock jumps instead.
  void run(Duration duration);
  /// The rig's clock jumps, as after a suspend.
  void jump(Duration by);
  Guest& connect();
  Vandal& intrude();
  void leave_all();
  void restart(std::unique_ptr<hal::sim::SimDisk> disk);
  /// Hosts upload this many bytes, which the rig may keep.
  void expect_bytes(std::size_t bytes) { bytes_sent_ += static_cast<std::int64_t>(bytes); }

  // The checks.
  /// After every operation: replies, memory, log, frames.
  void check();
  /// All hosts leave; memory must be as before, except for their uploads.
  void check_left_behind();
  /// One host sends the same request kRepeats times and leaves, then a second host does the same. Memory after the
  /// second must be as after the first, so that a leak per request is detected while it is small.
  void check_repeated(const wire::Request& request);
  /// All hosts leave and a good one connects: it is served, memory is as before, raymaps come at 90 % of the rate.
  void check_recovery();
  /// The hosts' settings are in effect again after a kill, and their file is within its size limit.
  void check_restart();

  firmware::Rig& rig() { return *rig_; }
  hal::sim::SimDisk& disk() { return *disk_; }
  Duration served() const { return served_; }
  std::vector<std::unique_ptr<Guest>>& guests() { return guests_; }
  std::vector<std::unique_ptr<Vandal>>& vandals() { return vandals_; }
  /// Sends a request and runs until the reply arrives.
  wire::Reply ask(Guest& guest, const wire::Request& request);
  void disk_fails(bool fails) { disk_failed_ |= fails; }

 private:
  void start();
  void take_news();
  void check_conserved();
  void check_settings_file();

  const std::int64_t heap_before_;  ///< declared first, so that all members below count
  std::int64_t heap_steady_ = 0;
  swarm::World world_;
  std::unique_ptr<hal::sim::SimDisk> disk_;
  std::unique_ptr<hal::sim::SimLinkListener> listener_;
  std::unique_ptr<hal::sim::SimWatchdog> watchdog_;
  std::unique_ptr<firmware::Rig> rig_;
  std::vector<std::unique_ptr<Guest>> guests_;
  std::vector<std::unique_ptr<Vandal>> vandals_;
  std::vector<std::uint64_t> taken_before_;  ///< by head, before this start of the rig
  Duration served_;                          ///< time during which the rig was stepped
  std::int64_t events_left_ = 3000;
  std::int64_t log_bytes_ = 0;  ///< since the rig's start
  Instant started_;
  std::int64_t bytes_sent_ = 0;
  bool disk_failed_ = false, program_ran_ = false;
};

}  // namespace nodal::fuzz
