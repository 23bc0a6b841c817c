// A whole small rig in virtual time, and what must hold of it whatever hosts, disk and clock do.
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

/// What somebody left on the disk; a name that no disk takes changes nothing.
void write_file(hal::sim::SimDisk& disk, const std::string& name, std::span<const std::uint8_t> bytes);

/// Two heads of 16 x 16 pixels at ten frames a second, a raymap of 16 x 8, the swarm's world. What breaks a rule
/// below aborts the program, which is how a fuzzer hears of it.
///
/// Threading: thread-bound.
/// Ownership: owns the world, the disk, the rig and its hosts.
/// Errors: none.
class Stand {
 public:
  // The rules.
  /// Live heap: 1.5 times what the steady rig has, and this. Hosts that are there may have messages, uploads and
  /// raymaps under way; when all have left, only what they uploaded and what is stored remains.
  static constexpr std::int64_t kInFlightBytes = 24 << 20, kLeftBehindBytes = 192 << 10;
  /// A request that is repeated leaves a record in the audit log, which has three texts of up to 240 bytes.
  static constexpr unsigned kRepeats = 16;
  static constexpr std::int64_t kRepeatedBytes = kRepeats * 1280;
  static constexpr Duration kReplyWithin = Duration::seconds(1);
  /// The log: bytes at once since a start, bytes a second more, what a line adds to its sentence, and how long a sentence
  /// may be. None holds control characters, with which a host could forge a line or reach a terminal.
  static constexpr std::int64_t kLogBytesAtOnce = 28 << 10, kLogBytesASecond = 600, kLineBytes = 40;
  static constexpr std::size_t kSentenceBytes = 600;
  /// Pulses, exposures and frames of the world that a virtual second may have, and one moment; past it time stands still
  /// for somebody.
  static constexpr std::int64_t kEventsASecond = 6000, kEventsAtOnce = 200;
  static constexpr int kTurnsToRest = 20'000;

  explicit Stand(std::unique_ptr<hal::sim::SimDisk> disk);
  ~Stand();

  /// A disk with the first of calibrations() in force.
  static std::unique_ptr<hal::sim::SimDisk> new_disk();
  static const std::array<Calibration, swarm::kCalibrations>& calibrations();
  static const firmware::RigConfig& config();

  // What the fuzzer does.
  void settle();
  /// The world goes on; when the events that the input may cost are used up, the clock jumps instead.
  void run(Duration duration);
  /// The rig's clock goes on at once, as after a suspend.
  void jump(Duration by);
  Guest& connect();
  Vandal& intrude();
  void leave_all();
  void restart(std::unique_ptr<hal::sim::SimDisk> disk);
  /// Hosts upload so many bytes, which the rig may keep.
  void expect_bytes(std::size_t bytes) { bytes_sent_ += static_cast<std::int64_t>(bytes); }

  // What must hold.
  /// After every operation: replies, memory, log, frames.
  void check();
  /// All hosts leave, and memory is as it was but for what they uploaded.
  void check_left_behind();
  /// One host asks the same thing kRepeats times and leaves, then a second host does the same. Memory after the second
  /// is as it was after the first, so that what adds up from request to request is seen while it is still small.
  void check_repeated(const wire::Request& request);
  /// All hosts leave and one good one comes: it is served, memory is as it was, and raymaps come at 90 % of the rate.
  void check_recovery();
  /// What hosts set is in effect again after the program was killed, and the file of it is no longer than it may be.
  void check_restart();

  firmware::Rig& rig() { return *rig_; }
  hal::sim::SimDisk& disk() { return *disk_; }
  Duration served() const { return served_; }
  std::vector<std::unique_ptr<Guest>>& guests() { return guests_; }
  std::vector<std::unique_ptr<Vandal>>& vandals() { return vandals_; }
  /// Asks and runs until the reply is there.
  wire::Reply ask(Guest& guest, const wire::Request& request);
  void disk_fails(bool fails) { disk_failed_ |= fails; }

 private:
  void start();
  void take_news();
  void check_conserved();
  void check_settings_file();

  const std::int64_t heap_before_;  ///< first, so that all below counts
  std::int64_t heap_steady_ = 0;
  swarm::World world_;
  std::unique_ptr<hal::sim::SimDisk> disk_;
  std::unique_ptr<hal::sim::SimLinkListener> listener_;
  std::unique_ptr<hal::sim::SimWatchdog> watchdog_;
  std::unique_ptr<firmware::Rig> rig_;
  std::vector<std::unique_ptr<Guest>> guests_;
  std::vector<std::unique_ptr<Vandal>> vandals_;
  std::vector<std::uint64_t> taken_before_;  ///< by head, before this start of the rig
  Duration served_;                          ///< during which the rig was stepped
  std::int64_t events_left_ = 3000;
  std::int64_t log_bytes_ = 0;  ///< since the rig's start
  Instant started_;
  std::int64_t bytes_sent_ = 0;
  bool disk_failed_ = false, program_ran_ = false;
};

}  // namespace nodal::fuzz
