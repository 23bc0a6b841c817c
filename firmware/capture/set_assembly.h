// The sets that frames are being put in, and the memory of all sets.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <vector>

#include "firmware/frame/frame_set.h"
#include "firmware/frame/outlet.h"
#include "firmware/sync/genlock.h"
#include "firmware/sync/set_clock.h"
#include "protocol/base/loan.h"

namespace nodal::firmware {

class CaptureLog;

/// Open sets, sorted by slot. At most kMaxOpenSets are open. Sets are closed in order, each is offered to all outlets,
/// and its frames go back when the last reader has released it.
///
/// Threading: thread-bound to capture; an outlet's other end is its reader's thread.
/// Ownership: owns the sets; readers hold loans and must release them before it is destroyed.
/// Errors: none.
class SetAssembly {
 public:
  struct OpenSet {
    SetClock::Slot slot = 0;
    SetLoan set;
    Skews skews;
  };
  static constexpr std::size_t kMaxOpenSets = 4;

  /// `returned`: takes the frames out of a set that no reader holds any more; `collection` counts the calls of
  /// collect() and open() in this step from 1.
  explicit SetAssembly(std::function<void(FrameSet& set, std::uint32_t collection)> returned);

  /// Before the first begin_step().
  Outlet<SetLoan>& add_outlet(const OutletSpec& spec, bool open);
  Outlets<SetLoan>& outlets() { return outlets_; }
  /// Null: nothing is noted.
  void log_to(CaptureLog* log) { log_ = log; }

  /// The first call makes the sets.
  void begin_step();
  /// Takes back the sets that no reader holds. Returns whether there was one.
  bool collect();

  /// The open set of this slot, or null.
  OpenSet* find(SetClock::Slot slot);
  /// The oldest set must be closed before a set of this slot can be opened.
  bool must_close_for(SetClock::Slot slot) const;
  /// Opens a set. Null if all that may be open are, or if a reader holds more sets than it registered for.
  OpenSet* open(SetClock::Slot slot);
  bool empty() const { return open_.empty(); }
  const OpenSet& oldest() const { return open_.front(); }
  /// Closes the oldest set; the caller completes it and calls offer().
  OpenSet close_oldest();
  void offer(const SetLoan& set) { outlets_.offer(set); }
  /// Slot of the newest closed set: frames up to it come too late.
  std::optional<SetClock::Slot> newest_closed() const { return newest_closed_; }
  /// Frames in open sets.
  std::uint64_t held() const;

 private:
  void note_collection();

  const std::function<void(FrameSet&, std::uint32_t)> returned_;
  CaptureLog* log_ = nullptr;
  Outlets<SetLoan> outlets_;
  std::optional<LoanPool<FrameSet>> sets_;  ///< made in the first step, when every outlet has registered
  std::vector<OpenSet> open_;               ///< sorted by slot, oldest first
  std::optional<SetClock::Slot> newest_closed_;
  std::uint32_t collections_ = 0;  ///< calls of collect() and open() in the current step
};

}  // namespace nodal::firmware
