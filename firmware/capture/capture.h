// The stage that takes frames from the heads and groups them into sets.
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <deque>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "firmware/capture/capture_head.h"
#include "firmware/capture/capture_pace.h"
#include "firmware/capture/exposure.h"
#include "firmware/capture/set_assembly.h"
#include "firmware/config/config.h"
#include "firmware/frame/frame_set.h"
#include "firmware/frame/outlet.h"
#include "firmware/frame/snapshot.h"
#include "firmware/sync/genlock.h"
#include "hal/head.h"
#include "hal/trigger.h"
#include "protocol/base/result.h"
#include "protocol/base/spsc_ring.h"

namespace nodal::firmware {

struct HeadChange {
  HeadMask heads = 0;
  SettingsChange change;
  std::uint64_t lease = 0;  ///< not 0: temporary, until this lease ends
};
/// Undoes the temporary changes of a lease.
struct LeaseEnd {
  std::uint64_t lease = 0;
};
struct GenlockStop {};
using CaptureCommand = std::variant<HeadChange, GenlockStart, GenlockStop, ExposureChange, LeaseEnd>;
/// A command with the ticket by which its answer is known.
struct CaptureRequest {
  std::uint64_t ticket = 0;
  CaptureCommand what;
};
struct CaptureAnswer {
  std::uint64_t ticket = 0;
  Instant at;  ///< when the command was carried out
  Status status;
  GenlockReport genlock;  ///< after the command
  ExposureControl::Report exposure;
};

class CaptureLog;

/// Status of one reader of frame sets.
struct OutletReport {
  std::string_view name;
  OutletLosses losses;
};

/// Status of the stage.
struct CaptureReport {
  std::vector<HeadReport> heads;
  FrameCounts frames;  ///< sum over all heads
  std::uint64_t sets = 0;
  std::uint64_t full_sets = 0;        ///< sets with every head of the rig
  std::vector<OutletReport> outlets;  ///< one report per outlet, in order of registration
  ExposureControl::Report exposure;
  GenlockReport genlock;
  FrameRate rate;  ///< at which sets come
};

/// A frame is held in an open set. The set is closed when every head that delivers has a frame in it, or
/// kHalfPeriodsToWait after the middle of its exposure, whichever is first. Sets are closed in order. Every outlet gets
/// a loan of the closed set; an outlet whose queue is full counts the set as missed, so capture never waits.
///
/// Threading: thread-bound to capture; an outlet's other end is its reader's thread; requests() and answers() are SPSC
///   rings whose other ends are control's; snapshot() is read by control.
/// Ownership: owns the sets; readers hold loans and must release them before capture is destroyed.
/// Errors: none; errors of a head are in its report.
class Capture {
 public:
  Capture(const RigConfig& config, hal::HeadEnumerator& heads, hal::TriggerPort* trigger);
  ~Capture();

  /// True when it did something.
  bool step(Instant now);
  /// Adds what wakes the thread, after step() returned false: the heads, the trigger, its own deadlines. Commands and
  /// loans that come back wake it too, by a bell.
  void add_wake_ups(hal::WakeUps& to) const;
  /// Stops heads and trigger. The blend must have released every set before.
  void close();

  /// Registers a reader of frame sets; call it before the first step(). A closed outlet receives no sets until it is
  /// opened.
  Outlet<SetLoan>& add_outlet(const OutletSpec& spec, bool open = true);
  /// The ring with the meter's readings. Without it the exposure programs change nothing.
  void meter_from(SpscRing<blend::SphereLight>& light) { light_in_ = &light; }
  /// Notes everything that determines what capture does; call it before the first step(). See capture_log.h.
  void log_to(CaptureLog& log);
  SpscRing<CaptureRequest>& requests() { return requests_; }
  SpscRing<CaptureAnswer>& answers() { return answers_; }
  Snapshot<CaptureReport>& snapshot() { return snapshot_; }
  const CaptureReport& report() const { return report_; }
  /// Number of calls of step(). Any thread.
  std::uint64_t steps() const { return steps_.load(std::memory_order_relaxed); }

  static constexpr std::size_t kMaxOpenSets = SetAssembly::kMaxOpenSets;
  static constexpr int kHalfPeriodsToWait = 5;
  /// Together with kMaxOpenSets periods: the largest plausible age of a frame on arrival.
  static constexpr Duration kOldest = Duration::seconds(1);

 private:
  bool run_commands(Instant now);
  Status carry_out(const CaptureCommand& command, Instant now);
  Status change_heads(const HeadChange& change);
  bool follow_light();
  bool take_frames();
  void place(std::size_t head, const hal::FrameView& frame);
  bool close_complete_sets();
  bool close_due_sets(Instant now);
  /// When the oldest open set is closed, complete or not.
  Instant due() const;
  void close_oldest();
  void close_all(Instant now);
  void release_frames(FrameSet& set, std::uint32_t collection);
  void log_changes();
  void update_report(Instant now, bool changed);
  void check() const;

  std::deque<CaptureHead> heads_;
  ExposureControl exposure_;
  SpscRing<blend::SphereLight>* light_in_ = nullptr;
  CapturePace pace_;
  SetAssembly assembly_;
  Instant now_;  ///< time of the current step

  CaptureLog* log_ = nullptr;  ///< null: nothing is noted
  /// What log_ knows.
  struct Logged {
    GenlockState genlock = GenlockState::kOff;
    std::array<std::array<std::uint64_t, kLossReasons>, kMaxHeads> losses{};
  } logged_;

  SpscRing<CaptureRequest> requests_;
  SpscRing<CaptureAnswer> answers_;
  Snapshot<CaptureReport> snapshot_;
  CaptureReport report_;
  Instant next_report_;
  std::uint64_t reported_sets_ = 0;
  std::atomic<std::uint64_t> steps_{0};
};

}  // namespace nodal::firmware
