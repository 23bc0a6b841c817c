// Follows takes: says what happens to them and to their disk, starts one with the rig, gives them calibrations.
#pragma once

#include <cstdint>
#include <deque>
#include <memory>
#include <optional>
#include <string>
#include <utility>

#include "firmware/operate/news.h"
#include "firmware/operate/stages.h"
#include "firmware/picture/calibration_swap.h"
#include "protocol/base/sha256.h"
#include "protocol/base/units.h"

namespace nodal::firmware {

/// Threading: thread-bound to control.
/// Ownership: all that it is made with outlives it.
/// Errors: none.
class TakeWatch {
 public:
  /// `adoption`: the blend's newest; `calibrations`: of the current take, null in a rig that records nothing;
  /// `at_start`: [takes] start = "boot".
  TakeWatch(Snapshot<Adoption>& adoption, SpscRing<TakeCalibration>* calibrations, bool at_start)
      : adoption_(adoption), calibrations_(calibrations), at_start_(at_start) {}

  /// Without effect in a rig that records nothing. True: a take is to be started now.
  bool step(const Reports& reports, News& news, Instant now);
  /// A take is being started, with this calibration.
  void note_start(const std::optional<Sha256>& calibration) { told_calibration_ = calibration; }

  /// [takes] start = "boot": the wait before a take is tried again, doubled each time.
  static constexpr Duration kFirstTakeWait = Duration::seconds(2), kLastTakeWait = Duration::seconds(64);

 private:
  bool wants_take(const Reports& reports, Instant now);
  void tell_calibration(const Reports& reports);

  Snapshot<Adoption>& adoption_;
  SpscRing<TakeCalibration>* const calibrations_;
  const bool at_start_;
  /// State of [takes] start = "boot".
  struct Start {
    bool begun = false;       ///< a take has been recorded since nodald started
    std::uint64_t disks = 0;  ///< TakeReport::disks at the newest try
    Instant next;             ///< no try before
    Duration wait = kFirstTakeWait;
  };
  Start start_;
  std::string problem_;                     ///< the newest that was logged
  std::string no_disk_;                     ///< the newest reason for no disk that was logged
  std::optional<Sha256> told_calibration_;  ///< the newest that the take has
  /// Calibrations that were in force last: the blend may still use one when the next is in force.
  using Document = std::shared_ptr<const std::string>;
  std::deque<std::pair<Sha256, Document>> documents_;
  static constexpr std::size_t kDocumentsKept = 8;
};

}  // namespace nodal::firmware
