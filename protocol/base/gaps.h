// What a take lacks, and the rates at which it was recorded, as its manifest sums them up; protocol/take/tally.h counts
// it.
#pragma once

#include <cstddef>
#include <cstdint>

#include "protocol/base/units.h"

namespace nodal::take {

/// Sets that are missing between two that are there.
struct Gap {
  std::uint64_t before = 0;  ///< index of the set after it
  /// Middle of the last set before it, by the rig's clock; of the set after it if there is none before.
  std::int64_t at_ns = 0;
  Duration length;            ///< without a set
  std::uint64_t slow = 0;     ///< sets that the rig had, and for which the disk or the board was too slow
  std::uint64_t error = 0;    ///< sets that were written, and that an error of the disk lost
  std::uint64_t capture = 0;  ///< sets that the rig did not make, by the time that passed

  std::uint64_t sets() const { return slow + error + capture; }
  friend bool operator==(const Gap&, const Gap&) = default;
};

/// A sum of gaps.
struct Gaps {
  std::uint64_t count = 0;
  std::uint64_t slow = 0;
  std::uint64_t error = 0;
  std::uint64_t capture = 0;
  Duration longest;
  std::uint64_t longest_before = 0;  ///< index of the set after the longest

  std::uint64_t sets() const { return slow + error + capture; }
  friend bool operator==(const Gaps&, const Gaps&) = default;
};

/// Pictures of one head that are not in the sets of a take, by reason (Frame::placeholder of evidence.proto).
struct HeadGaps {
  std::uint64_t missing = 0;
  std::uint64_t format = 0;
  std::uint64_t encoder = 0;

  std::uint64_t sum() const { return missing + format + encoder; }
  friend bool operator==(const HeadGaps&, const HeadGaps&) = default;
};

/// A rate at which sets were recorded.
struct RateChange {
  std::uint64_t set = 0;  ///< index of the first set with it
  FrameRate rate;
  friend bool operator==(const RateChange&, const RateChange&) = default;
};

}  // namespace nodal::take
