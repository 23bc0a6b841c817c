// Counts, from the evidence of a take, what it lacks and at which rates it was recorded: for the rig that writes the
// manifest, and for a host that reads a copy.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <optional>
#include <vector>

#include "protocol/base/gaps.h"
#include "protocol/base/units.h"
#include "protocol/take/evidence.h"

namespace nodal::take {

/// No sum is above kMaxSets.
void add(Gaps& to, const Gap& gap);
void add(Gaps& to, const Gaps& other);
void add(HeadGaps& to, const HeadGaps& other);
/// What `part` has is no longer counted. The longest gap stays that of all.
void remove(Gaps& from, const Gaps& part);
void remove(HeadGaps& from, const HeadGaps& part);

/// The rate in force in a segment: `otherwise`, that of take.json, if the evidence does not say it.
FrameRate rate_of(const wire::Begin& begin, FrameRate otherwise);
/// Whether two rates are one, measured twice: within 1000 ppm.
bool same_rate(FrameRate a, FrameRate b);

/// One segment. Sets are added in their order.
///
/// Threading: thread-bound.
/// Ownership: none.
/// Errors: none; any evidence that read_evidence() accepts may be counted.
class SegmentTally {
 public:
  SegmentTally() = default;
  explicit SegmentTally(FrameRate rate) : rate_(rate) {}
  /// What is missing between this set and the one before it in the segment; nothing if nothing is.
  std::optional<Gap> add(const wire::Begin& begin, const wire::Set& set);

  FrameRate rate() const { return rate_; }
  std::uint64_t sets() const { return sets_; }
  const Gaps& gaps() const { return gaps_; }
  const std::array<HeadGaps, kMaxHeads>& heads() const { return heads_; }

 private:
  friend class Tally;
  struct Moment {
    std::uint64_t index = 0;
    std::uint64_t number = 0;
    std::uint64_t missed = 0;
    std::int64_t at_ns = 0;
  };
  static Gap between(const Moment& before, const Moment& after, Duration period, bool error);

  FrameRate rate_;
  std::uint64_t sets_ = 0;
  std::optional<Moment> first_, last_;
  Gaps gaps_;
  std::array<HeadGaps, kMaxHeads> heads_{};
  bool after_error_ = false;  ///< an error of the disk lost what is missing before it
};

/// Tally of the segment's evidence. `found` is called with every gap in it.
SegmentTally tally_of(const Segment& segment, FrameRate otherwise, const std::function<void(const Gap&)>& found = {});

/// A take: its segments in their order. Sets that were deleted to make room are not missing.
class Tally {
 public:
  /// What is missing between the segment and the one before it; nothing if nothing is.
  std::optional<Gap> add(const SegmentTally& segment);

  const Gaps& gaps() const { return gaps_; }
  const std::array<HeadGaps, kMaxHeads>& heads() const { return heads_; }
  /// At least one for a take with a set; at most kMaxRates.
  const std::vector<RateChange>& rates() const { return rates_; }

 private:
  std::optional<SegmentTally::Moment> last_;
  FrameRate last_rate_;
  Gaps gaps_;
  std::array<HeadGaps, kMaxHeads> heads_{};
  std::vector<RateChange> rates_;
};

}  // namespace nodal::take
