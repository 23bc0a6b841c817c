// Exposure programs: from metered light to the settings that are requested from the heads.
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

/// The range of a head's shutter and gain.
struct ExposureRange {
  Exposure shortest, longest;
  Gain lowest, highest;
};

struct ExposureOrder {
  Exposure exposure;
  Gain gain;
};

/// Splits an exposure in stops into shutter and gain within the range: the shutter as long as possible, the gain for
/// the rest. The gain also supplies what rounding the shutter to whole microseconds leaves.
ExposureOrder split(Stops stops, const ExposureRange& range);
/// The lowest and the highest exposure of the range.
std::pair<Stops, Stops> reach(const ExposureRange& range);

/// A closed loop that needs no model of its delay: every set carries the settings that were in effect for it, so the
/// goal computed from its light does not depend on later requests. The requested exposure approaches the goal and never
/// passes it. Metering never overestimates a change (blend::meter), so an inexact goal lies between the exposure and
/// the right one.
///
///   error of a head's exposure | change per set
///   at most kRest, after it was within kStep | none, so that noise changes nothing
///   at most kNear | kStep, 1 % of the light, which is not visible
///   at most one stop | half of the error
///   larger | all of it
/// and never more than `ramp`.
///
/// In the joint program all heads change in proportion, so that neighbours that were within `difference` stay within
/// it.
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
    HeadMask heads = 0;  ///< heads with an order in `of`
    std::array<ExposureOrder, kMaxHeads> of{};
  };

  struct Report {
    ExposureSettings settings;
    bool settled = false;     ///< every head is within kNear of its goal
    std::uint64_t sets = 0;   ///< number of metered sets
    blend::SphereLight seen;  ///< reading of the newest one
    std::array<Stops, kMaxHeads> goal{};
  };

  explicit ExposureControl(const ExposureSettings& settings) { set(settings); }

  /// New settings, whose anchor is one of kMaxHeads heads. Exposures continue from their present values.
  void set(const ExposureSettings& settings);
  /// Takes the reading of the next metered set and returns the new settings of the heads. Only heads with a range get
  /// any.
  Orders step(const blend::SphereLight& seen, std::span<const std::optional<ExposureRange>, kMaxHeads> ranges);
  /// The head is disconnected: forgets its requested exposure.
  void forget(std::size_t head) { requested_[head].reset(); }
  const Report& report() const { return report_; }

 private:
  void find_goals(HeadMask present);
  void limit_differences(HeadMask present);

  Report report_;
  std::array<std::optional<Stops>, kMaxHeads> requested_{};
  HeadMask resting_ = 0;
};

}  // namespace nodal::firmware
