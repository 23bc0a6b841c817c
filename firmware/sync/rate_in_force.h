// The rate at which sets really come: as the trigger was commanded, or as it is measured where that differs.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>

#include "protocol/base/units.h"

namespace nodal::firmware {

/// Heads that run free, and a trigger of another device, have rates of their own. Over kSteps sets, the mean time from
/// one to the next is compared with the commanded rate; steps that are far from the median, such as those over lost
/// sets, are left out.
///
/// Threading: thread-bound to capture.
/// Ownership: none. Allocates nothing.
/// Errors: none.
class RateInForce {
 public:
  void restart(FrameRate commanded);
  /// A set was closed. `drift_ppb`: of its SyncEvidence.
  void add(Instant middle, std::optional<std::int32_t> drift_ppb);
  /// The commanded rate, unless sets come at another.
  FrameRate rate() const { return rate_; }

  static constexpr std::size_t kSteps = 64;
  /// A measured drift up to this is within what is measured of a rig without one.
  static constexpr std::int32_t kExactPpb = 20'000;

 private:
  std::optional<Duration> measured() const;

  FrameRate commanded_, rate_;
  std::optional<Instant> newest_;
  std::array<std::int64_t, kSteps> steps_{};  ///< ns
  std::size_t count_ = 0;
};

/// The simplest fraction whose period is within `ppb` of this one; nothing if no FrameRate is.
std::optional<FrameRate> rate_with_period(Duration period, std::int64_t ppb);

}  // namespace nodal::firmware
