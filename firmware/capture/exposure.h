// Exposure programs: from what the heads saw to what they are asked next.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <utility>

#include "firmware/config/exposure_settings.h"
#include "firmware/frame/frame_set.h"
#include "protocol/base/stops.h"
#include "protocol/base/units.h"
#include "stitch/blend/meter.h"

namespace nodal::firmware {

/// What a head can do, in its own units.
struct ExposureRange {
  Exposure shortest, longest;
  Gain lowest, highest;
};

struct ExposureOrder {
  Exposure exposure;
  Gain gain;
};

/// The shutter and gain that let through so many stops_of(), within the range: a shutter as long as may be, and gain
/// for what it lacks. What shutters cannot do in whole microseconds, gain does too.
ExposureOrder split(Stops stops, const ExposureRange& range);
/// What the range reaches.
std::pair<Stops, Stops> reach(const ExposureRange& range);

/// Closed loop, without a model of its delay: every set says what was in effect for it, so what it saw says where
/// exposures should be, whatever has been asked since; that goal is walked to and never past. Metering never tells
/// more than it knows (blend::meter), so a goal that is not yet the right one lies before it.
///
///   error of a head's exposure | it moves, each set
///   within kRest, after it came to rest | not at all: noise moves nothing
///   within kNear | by kStep, a hundredth of its light, which is not seen
///   within a stop | by half of the error
///   beyond | by all of it
/// and never by more than `ramp`.
///
/// In the joint program all heads move in proportion, so that neighbours that were within `difference` stay so.
///
/// Threading: thread-bound to capture.
/// Ownership: none. Allocates nothing.
/// Errors: none.
class ExposureControl {
 public:
  static constexpr Stops kStep = kStop / 64;
  static constexpr Stops kNear = kStop / 8;
  static constexpr Stops kRest = kStop / 16;

  struct Orders {
    HeadMask heads = 0;  ///< which of them
    std::array<ExposureOrder, kMaxHeads> of{};
  };

  struct Report {
    ExposureSettings settings;
    bool settled = false;     ///< every head is within kNear of its goal
    std::uint64_t sets = 0;   ///< that were metered
    blend::SphereLight seen;  ///< the newest of them
    std::array<Stops, kMaxHeads> goal{};
  };

  explicit ExposureControl(const ExposureSettings& settings) { report_.settings = settings; }

  /// From here on. Exposures go on from where they are.
  void set(const ExposureSettings& settings);
  /// A metered set, oldest first. What the heads are to be asked: only heads with a range are.
  Orders step(const blend::SphereLight& seen, std::span<const std::optional<ExposureRange>, kMaxHeads> ranges);
  /// A head went: what it was asked is forgotten.
  void forget(std::size_t head) { asked_[head].reset(); }
  const Report& report() const { return report_; }

 private:
  void find_goals(HeadMask present);
  void limit_differences(HeadMask present);

  Report report_;
  std::array<std::optional<Stops>, kMaxHeads> asked_{};
  HeadMask resting_ = 0;
};

}  // namespace nodal::firmware
