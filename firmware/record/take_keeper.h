// The stage that writes takes to the disk. TakeShelf knows the takes that are there.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "firmware/config/config.h"
#include "firmware/frame/presence.h"
#include "firmware/frame/snapshot.h"
#include "firmware/picture/blender.h"
#include "firmware/record/disk_test.h"
#include "firmware/record/recorder.h"
#include "firmware/record/take_shelf.h"
#include "firmware/record/waiting_tickets.h"
#include "hal/confined.h"
#include "hal/disk.h"
#include "protocol/base/gaps.h"
#include "protocol/base/result.h"
#include "protocol/base/sha256.h"
#include "protocol/base/spsc_ring.h"

namespace nodal::take {
struct TakeDocument;
}

namespace nodal::firmware {

class FlightLog;
class TakeWriter;

struct TakeRequest {
  struct Start {
    std::optional<Sha256> calibration{};  ///< hash of the calibration in force; empty: none
    std::string calibration_json{};       ///< canonical form of that calibration
    HeadShapes heads{};                   ///< shapes of the heads' pictures, to estimate the room that a take needs
    bool still = false;                   ///< the take is one set; the answer comes when the set is on the disk
    std::optional<FrameRate> rate{};      ///< rate of the sets; empty: not known, and the one in rig.toml is used
  };
  struct Stop {};
  struct Mark {
    std::string text;
    static constexpr std::size_t kMaxBytes = 200;
  };
  struct List {};
  struct Delete {
    std::uint64_t take = 0;
    std::optional<Sha256> manifest{};  ///< if set, only a take with this manifest is deleted
  };
  struct Protect {
    std::uint64_t take = 0;
    bool on = false;
  };
  struct TestDisk {
    Duration length = Duration::seconds(10);
    HeadShapes heads{};  ///< shapes of the heads' pictures, to estimate what each mode needs
    std::optional<FrameRate> rate{};
    /// A running test also answers later requests, and is extended to the length that they ask for. A test may always
    /// last this long.
    static constexpr Duration kShared = Duration::seconds(10);
  };
  /// Ends the take, syncs the disk and stops using it, so that it can be removed. Done names the take; 0: none was
  /// being recorded.
  struct Eject {};
  using What = std::variant<List, Start, Stop, Mark, Delete, Protect, TestDisk, Eject>;

  std::uint64_t ticket = 0;
  What what;
  Presence host{};
};
using TakeCommand = TakeRequest::What;

struct TakeAnswer {
  struct Listed {
    std::vector<TakeEntry> takes;
  };
  struct Done {
    std::uint64_t take = 0;
  };
  struct DiskTested {
    DiskSpeed speed;
    std::vector<DiskVerdict> modes;
  };
  std::uint64_t ticket = 0;
  Result<std::variant<Listed, Done, DiskTested>> result;
};

/// Status of the stage.
struct TakeReport {
  /// The takes on the disk have been read, and interrupted ones have been recovered, or another process is recovering
  /// them.
  bool ready = false;
  std::string no_disk;      ///< why nothing can be recorded on the disk now; empty: the disk is usable
  bool ejected = false;     ///< a host ejected the disk; it is not used until it is inserted again, or another one is
  std::uint64_t disks = 0;  ///< number of disks that have come since nodald started
  /// The newest take ended, or the newest start was refused, for a temporary reason: a fault of the disk, no room, or
  /// an eject.
  bool interrupted = false;
  bool has_room = true;  ///< as far as is known without deleting anything, there is room to start a take
  std::optional<std::uint64_t> recording;
  Instant since;
  std::uint64_t sets = 0;            ///< sets of the current take
  std::uint64_t lost_sets = 0;       ///< lost sets of the current take
  std::uint64_t lost_by_errors = 0;  ///< how many of lost_sets were lost by an error of the disk, not by its speed
  std::uint64_t lost_raymaps = 0;
  bool leaves_out_raymaps = false;   ///< raymaps are not recorded at the moment because the buffer is too full
  int quality = 0;                   ///< quality of the JPEGs that the rig encodes now; 0: it encodes none
  std::uint32_t buffer_percent = 0;  ///< used part of [takes] buffer_mb
  std::optional<Instant> durable;    ///< everything recorded before this moment is on the disk
  std::uint64_t free_bytes = 0;
  std::uint64_t bytes_a_second = 0;           ///< write rate that the take needs
  std::optional<std::uint32_t> test_percent;  ///< progress of the running test of the disk; empty: none runs
  bool loop = false;                          ///< [takes] when_full = "loop"
  std::uint64_t deleted_segments = 0;         ///< segments deleted since nodald started to make room
  std::string problem;                        ///< fault of the disk, or why the last take ended
  std::string refused;  ///< why the last requested take was not started; the audit log has it, too
};

/// Writes each row that the recorder has closed, and syncs everything twice a second. Only requests for takes wait for
/// the disk; no other stage does.
///
/// Threading: step() is thread-bound to the takes' thread, which blocks on the disk. requests(), calibrations() and
///   answers() are SPSC rings with control, snapshot() is read by control.
/// Ownership: disk and recorder outlive it.
/// Errors: in the answers, and in the report's problem.
class TakeKeeper {
 public:
  /// The board's clock in nanoseconds since 1970; 0: unknown.
  using UtcClock = std::function<std::int64_t()>;

  /// `flight`: the log that [takes] flight_recorder records; null without it. `places_seams`: the blend stage, if it
  /// places seams and logs them; null if seams are fixed. `confined`: the process in which takes are recovered; null:
  /// in step().
  TakeKeeper(const RigConfig& config, hal::DiskPort& disk, Recorder& recorder, std::string software, UtcClock utc,
             FlightLog* flight = nullptr, Blender* places_seams = nullptr, hal::ConfinedPort* confined = nullptr);
  ~TakeKeeper();

  /// True when it did something.
  bool step(Instant now);
  /// Ends the take that is being recorded. The recorder must not be in step().
  void close(Instant now);

  SpscRing<TakeRequest>& requests() { return requests_; }
  SpscRing<TakeCalibration>& calibrations() { return calibrations_; }
  SpscRing<TakeAnswer>& answers() { return answers_; }
  Snapshot<TakeReport>& snapshot() { return snapshot_; }
  TakesInUse& in_use() { return shelf_.in_use(); }

  static constexpr Duration kSyncEvery = Duration::milliseconds(500);
  /// A take starts only if the disk has room for this long a take and kReserveBytes.
  static constexpr Duration kLeastRoom = Duration::seconds(60);
  /// The same in a loop. It is longer because only finished segments, of up to a minute each, can be deleted to make
  /// room for the segment that is being written.
  static constexpr Duration kLeastLoopRoom = Duration::seconds(150);
  /// Room that is kept free to finish the files of a take.
  static constexpr std::uint64_t kReserveBytes = std::uint64_t{64} << 20;
  /// A still ends after this time even if it has no set; normally the recorder ends it earlier. The host waits longer.
  static constexpr FrameTime kStillWithin{Duration::seconds(6), 9};
  /// [takes] when_full = "loop": segments are deleted when the disk has less room than for this time and kReserveBytes.
  static constexpr Duration kLoopAhead = Duration::seconds(5);
  static constexpr int kRowsAStep = 4;
  /// With placed seams, a row is written after the blend has begun its sets, because then the blend has logged their
  /// seams. The row is written without waiting if the blend has begun no set for kBlendWithin, or if more than
  /// kSetsAhead percent of the recorder's memory is used.
  static constexpr Duration kBlendWithin = Duration::seconds(1);
  static constexpr std::size_t kSetsAhead = 20;
  /// Records of a flight record that a step writes: nodald's first hour is written in less than 2 s.
  static constexpr int kFlightRecordsAStep = 32;
  static constexpr Duration kReportEvery = Duration::milliseconds(200);
  /// Interval of the checks whether a disk was inserted or removed.
  static constexpr Duration kLookEvery = Duration::seconds(1);

 private:
  using Answered = std::variant<TakeAnswer::Listed, TakeAnswer::Done, TakeAnswer::DiskTested>;

  bool watch_disk(Instant now);
  bool take_request(Instant now);
  std::optional<TakeRequest> next_request();
  void let_wait(WaitingTickets& tickets, const TakeRequest& request);
  bool drop_gone(WaitingTickets& tickets);
  Result<std::optional<Answered>> run(const TakeRequest& request, Instant now);
  Result<std::uint64_t> start(const TakeRequest::Start& start, Instant now);
  Status begin_test(const TakeRequest& request, const TakeRequest::TestDisk& what, Instant now);
  bool step_test(Instant now);
  void end_test(Result<TakeAnswer::DiskTested> result);
  std::uint64_t set_bytes(const HeadShapes& heads, std::optional<TakeMode> mode = std::nullopt) const;
  bool step_eject();
  Status make_room_while_recording();
  void answer_end(std::uint64_t take, const Result<take::Manifest>& manifest, bool empty_still);
  std::uint64_t bytes_a_second() const;
  std::uint64_t room_to_start() const;
  Status check_room();
  bool store_calibration();
  bool take_seams();
  bool blend_is_behind(const TakeRow& row, Instant now);
  bool write_rows(Instant now);
  void begin_flight();
  bool write_flight(Instant now, int most);
  void end_flight(Instant now);
  void sync_if_due(Instant now);
  void give_up(const Error& error);
  void end_late_still(Instant now);
  Status check_pictures(const HeadShapes& heads) const;
  void describe(take::TakeDocument& about, Instant now) const;
  void tell_to_end(const std::string& reason);
  void end(Instant now);
  void answer(std::uint64_t ticket, Result<Answered> result);
  void publish(Instant now);

  const RigConfig config_;
  hal::DiskPort& disk_;
  Recorder& recorder_;
  const std::string software_;
  const UtcClock utc_;
  FlightLog* const flight_;
  Blender* const places_seams_;
  SpscRing<TakeRequest> requests_;
  SpscRing<TakeCalibration> calibrations_;
  SpscRing<TakeAnswer> answers_;
  Snapshot<TakeReport> snapshot_;
  TakeReport report_;

  TakeShelf shelf_;
  Instant next_look_;

  struct Test {
    WaitingTickets tickets;  ///< tickets of all requests that wait for the test's result
    TakeShelf::Hold held;
    HeadShapes heads;
    std::unique_ptr<DiskTest> test;
  };
  std::optional<Test> test_;
  std::optional<TakeShelf::Hold> held_;  ///< claims the disk while a take is recorded
  std::unique_ptr<TakeWriter> writing_;
  std::unique_ptr<TakeRow> row_;     ///< the next row, which waits for the blend to log its seams
  std::optional<SeamChange> seams_;  ///< newest seams
  std::uint64_t begun_ = 0;          ///< Blender::sets_begun() when it was last read
  Instant begun_at_;
  bool closing_ = false;  ///< nodald ends: the blend begins no more sets
  /// Tickets that are answered when the take has ended: those of Stop, and that of a still's Start.
  std::vector<std::uint64_t> stopping_;
  bool ejecting_ = false;           ///< an eject waits for the end of the take and of a read
  WaitingTickets ejects_;           ///< tickets of Eject; the disk is ejected even if their hosts disconnect
  std::uint64_t ejected_take_ = 0;  ///< the take that Eject ended
  bool still_ = false;              ///< the take is a still
  Duration period_;                 ///< period of the frame rate when the take began
  bool ending_ = false;             ///< the recorder was asked to end the take
  std::string reason_;              ///< why the take ends
  std::string cause_;               ///< why the take ended without a request; empty: it did not
  std::string lost_by_sync_;        ///< what a failed sync cost, until it is reported
  bool broken_ = false;             ///< the disk failed: rows are dropped, up to the last one
  std::uint64_t given_sets_ = 0;    ///< sets that were passed to the writer, or dropped after an error
  std::uint64_t expected_set_bytes_ = 0;
  FrameRate rate_;                 ///< rate of the sets when the newest take or test began
  std::uint64_t lost_before_ = 0;  ///< Recorder's counts when the take began
  std::uint64_t raymaps_lost_before_ = 0;
  Instant next_sync_;
  Instant next_report_;
};

}  // namespace nodal::firmware
