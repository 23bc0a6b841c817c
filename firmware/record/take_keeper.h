// The stage that writes takes to the disk. TakeShelf has the finished takes; Recording is the one that is recorded.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "firmware/config/config.h"
#include "firmware/frame/snapshot.h"
#include "firmware/picture/blender.h"
#include "firmware/record/data_rate.h"
#include "firmware/record/host_disk_test.h"
#include "firmware/record/recorder.h"
#include "firmware/record/seam_feed.h"
#include "firmware/record/take_mailbox.h"
#include "firmware/record/take_messages.h"
#include "firmware/record/take_shelf.h"
#include "firmware/record/waiting_tickets.h"
#include "hal/confined.h"
#include "hal/disk.h"
#include "protocol/base/result.h"
#include "protocol/base/spsc_ring.h"

namespace nodal::firmware {

class FlightLog;
class Recording;

/// Only requests for takes wait for the disk; no other stage does.
///
/// Threading: step() is thread-bound to the takes' thread, which blocks on the disk. requests(), calibrations() and
///   answers() are SPSC rings with control, snapshot() is read by control.
/// Ownership: disk and recorder outlive it.
/// Errors: in the answers, and in the report's problem.
class TakeKeeper {
 public:
  /// The board's clock in nanoseconds since 1970; 0: unknown.
  using UtcClock = std::function<std::int64_t()>;

  /// `flight`: the log that [takes] flight_recorder records; null without it. `seams`: the
  /// blend's log of placed seams; null if seams are fixed. `confined`: the process in which takes are recovered; null:
  /// in step().
  TakeKeeper(const RigConfig& config, hal::DiskPort& disk, Recorder& recorder, std::string software, UtcClock utc,
             FlightLog* flight = nullptr, SeamLog* seams = nullptr, hal::ConfinedPort* confined = nullptr);

  ~TakeKeeper();

  /// True when it did something.
  bool step(Instant now);
  /// Ends the take that is being recorded. The recorder must not be in step().
  void close(Instant now);

  SpscRing<TakeRequest>& requests() { return mail_.requests(); }
  SpscRing<TakeCalibration>& calibrations() { return calibrations_; }
  SpscRing<TakeAnswer>& answers() { return mail_.answers(); }
  Snapshot<TakeReport>& snapshot() { return snapshot_; }
  TakesInUse& in_use() { return shelf_.in_use(); }

  /// A take starts only if the disk has room for this long a take and for finishing its files.
  static constexpr Duration kMinRoom = Duration::seconds(60);
  /// The same in a loop. It is longer because only finished segments, of up to a minute each, can be deleted to make
  /// room for the segment that is being written.
  static constexpr Duration kMinLoopRoom = Duration::seconds(150);
  static constexpr Duration kReportEvery = Duration::milliseconds(200);
  /// Interval of the checks whether a disk was inserted or removed.
  static constexpr Duration kLookEvery = Duration::seconds(1);

 private:
  bool watch_disk(Instant now);
  bool step_recording(Instant now);
  bool take_request(Instant now);
  Result<std::optional<TakeMailbox::Answered>> run(const TakeRequest& request, Instant now);
  Result<std::uint64_t> start(const TakeRequest::Start& start, Instant now);
  std::uint64_t room_to_start() const;
  Status check_room();
  void end(Instant now);
  bool step_eject();
  void publish(Instant now);

  const RigConfig config_;
  hal::DiskPort& disk_;
  Recorder& recorder_;
  const std::string software_;
  const UtcClock utc_;
  FlightLog* const flight_;
  SpscRing<TakeCalibration> calibrations_;
  Snapshot<TakeReport> snapshot_;
  TakeReport report_;
  TakeMailbox mail_;
  TakeShelf shelf_;
  SeamFeed seams_;
  HostDiskTest test_;
  std::unique_ptr<Recording> recording_;
  DataRate rate_;  ///< what the sets of the newest take need
  /// Tickets that are answered when the take has ended: those of Stop, and that of a still's Start.
  std::vector<std::uint64_t> stopping_;
  struct Eject {
    WaitingTickets tickets;  ///< the disk is ejected even if their hosts disconnect
    std::uint64_t take = 0;  ///< the take that Eject ended
  };
  std::optional<Eject> ejecting_;  ///< an eject that waits for the end of the take and of a read
  Instant next_look_;
  Instant next_report_;
};

}  // namespace nodal::firmware
