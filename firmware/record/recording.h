// One take while it is recorded.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>

#include "firmware/record/data_rate.h"
#include "firmware/record/recorder.h"
#include "firmware/record/seam_feed.h"
#include "firmware/record/take_messages.h"
#include "firmware/record/take_shelf.h"
#include "firmware/record/take_writer.h"
#include "protocol/base/result.h"
#include "protocol/base/units.h"

namespace nodal::firmware {

class FlightLog;

/// Writes each row that the recorder has closed. Twice a second it syncs everything and makes room. To end a take, it
/// asks the recorder to end; the rows that the recorder closes until then are still written, or dropped if the disk
/// failed.
///
/// Threading: thread-bound to the takes' stage, which blocks on the disk.
/// Ownership: all that it is made with outlives it. It holds the disk.
/// Errors: the take ends, with its cause.
class Recording {
 public:
  /// What a take is recorded with.
  struct Parts {
    Recorder& recorder;
    TakeShelf& shelf;
    SeamFeed& seams;
    FlightLog* flight;  ///< null: without a flight record
    bool loop;          ///< [takes] when_full = "loop"
  };
  struct Order {
    bool raymaps = false;  ///< raymaps are recorded, too
    bool still = false;    ///< the take is one set
    DataRate rate;
  };
  enum class Phase : std::uint8_t {
    kRunning,
    kEnding,    ///< the recorder was asked to end; its last rows are being written
    kDropping,  ///< the same after an error of the disk: its last rows are dropped
    kFlight,    ///< all rows were written; the rest of the flight record is being written
    kOver,
  };
  struct Ended {
    std::uint64_t take = 0;
    Result<take::Manifest> manifest;
    std::string cause;         ///< why it ended without a request; empty: it did not
    bool empty_still = false;  ///< no set came
  };

  Recording(const Parts& parts, const Order& order, std::unique_ptr<TakeWriter> writer, TakeShelf::Hold held,
            Instant now, TakeReport& report);

  /// True when it did something. `utc_ns`: the board's clock.
  bool step(Instant now, std::int64_t utc_ns, TakeReport& report);
  /// Stores a calibration that was put in force.
  void use_calibration(const TakeCalibration& calibration, TakeReport& report);
  Status mark(const std::string& text, Instant now) { return writer_->mark(text, now); }
  /// Asks the recorder to end, unless it was asked before.
  void end(const std::string& reason);
  /// nodald ends: nothing waits for the blend any more.
  void close();
  /// In phase kOver: finishes the files.
  Ended finish();

  Phase phase() const { return phase_; }
  std::uint64_t number() const { return writer_->number(); }
  /// Fills in the counts of sets and of losses.
  void fill(TakeReport& report) const;

  static constexpr Duration kSyncEvery = Duration::milliseconds(500);
  /// Room that is kept free to finish the files of a take.
  static constexpr std::uint64_t kReserveBytes = std::uint64_t{64} << 20;
  /// A still ends after this time even if it has no set; normally the recorder ends it earlier. The host waits longer.
  static constexpr FrameTime kStillWithin{Duration::seconds(6), 9};
  /// [takes] when_full = "loop": segments are deleted when the disk has less room than for this time and kReserveBytes.
  static constexpr Duration kLoopAhead = Duration::seconds(5);
  static constexpr int kRowsAStep = 4;
  /// A row does not wait for the blend when more than this percentage of the recorder's memory is used.
  static constexpr std::size_t kSetsAhead = 20;
  /// Records of a flight record that a step writes: nodald's first hour is written in less than 2 s.
  static constexpr int kFlightRecordsAStep = 32;

 private:
  bool writes() const { return phase_ == Phase::kRunning || phase_ == Phase::kEnding; }
  bool write_rows(Instant now);
  bool write_flight();
  void sync_if_due(Instant now, std::int64_t utc_ns, TakeReport& report);
  Result<std::uint64_t> make_room();
  void give_up(const Error& error);

  const Parts parts_;
  const Order order_;
  std::unique_ptr<TakeWriter> writer_;
  TakeShelf::Hold held_;
  const Instant since_;
  std::unique_ptr<TakeRow> row_;  ///< the next row, which waits for the blend to log its seams
  Phase phase_ = Phase::kRunning;
  std::string reason_;
  std::string cause_;             ///< why the take ended without a request; empty: it did not
  std::string lost_by_sync_;      ///< what a failed sync cost, until it is reported
  std::uint64_t given_sets_ = 0;  ///< sets that were passed to the writer, or dropped after an error
  struct Losses {
    std::uint64_t sets = 0;
    std::uint64_t raymaps = 0;
  };
  const Losses before_;  ///< the recorder's counts when the take began
  Instant next_sync_;
};

}  // namespace nodal::firmware
