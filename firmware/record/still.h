// Which set a still records: the first one with every head.
#pragma once

#include <cstdint>
#include <optional>

#include "firmware/frame/frame_set.h"
#include "protocol/base/frame_time.h"
#include "protocol/base/units.h"

namespace nodal::firmware {

/// A take of one set and its raymaps. It waits kWaits for a set with all heads and then takes the next one as it is;
/// after its set it waits kWaits for the raymaps.
///
/// Threading: thread-bound to the recorder.
/// Ownership: none.
/// Errors: none.
class Still {
 public:
  static constexpr FrameTime kWaits{Duration::seconds(2), 3};

  Still(std::size_t heads, int raymaps_a_set) : heads_(heads), raymaps_a_set_(raymaps_a_set) {}

  /// A take begins. `wanted`: it is a still; `raymaps`: with raymaps.
  void begin(bool wanted, bool raymaps) {
    wanted_ = wanted;
    raymaps_ = raymaps ? raymaps_a_set_ : 0;
    set_.reset();
    since_.reset();
  }
  /// The take is a still.
  bool wanted() const { return wanted_; }

  enum class Use : std::uint8_t { kRecord, kLeaveOut, kEnd };
  /// What the take does with a set. kEnd: its raymaps do not come, so it ends without them.
  Use use_of(const FrameSet& set) {
    if (!wanted_) return Use::kRecord;
    if (!since_) since_ = set.mid_exposure;
    const bool waited = set.mid_exposure - *since_ >= kWaits.at(set.period);
    if (set_) return waited ? Use::kEnd : Use::kLeaveOut;
    bool all = true;
    for (std::size_t head = 0; head < heads_; ++head) all &= set.has(head);
    return all || waited ? Use::kRecord : Use::kLeaveOut;
  }
  /// The set was recorded. True: the still needs nothing more.
  bool on_recorded(const FrameSet& set) {
    since_ = set.mid_exposure;
    set_ = set.number;
    return wanted_ && raymaps_ == 0;
  }
  /// Whether the take records this raymap, of the set with this number.
  bool takes_raymap(std::uint64_t set) const { return !wanted_ || set_ == set; }
  /// The raymap was recorded. True: the still needs nothing more.
  bool on_raymap() { return wanted_ && --raymaps_ == 0; }

 private:
  const std::size_t heads_;
  const int raymaps_a_set_;
  bool wanted_ = false;
  int raymaps_ = 0;  ///< raymaps that have not arrived yet
  std::optional<std::uint64_t> set_;
  /// Time of the first set offered; once one is recorded, its time.
  std::optional<Instant> since_;
};

}  // namespace nodal::firmware
