// A V4L2 device's exposure, gain and white balance.
#pragma once

#include <linux/videodev2.h>

#include <cstdint>
#include <optional>

#include "hal/head.h"
#include "hal/linux/device/controls.h"
#include "hal/linux/v4l2/device.h"

namespace nodal::hal::v4l2 {

/// Exposure is V4L2_CID_EXPOSURE_ABSOLUTE, in 100 us. Gain is V4L2_CID_GAIN or V4L2_CID_ANALOGUE_GAIN, with
/// `gain_step_mdb` per step. White balance is V4L2_CID_RED_BALANCE and V4L2_CID_BLUE_BALANCE; their defaults count as
/// 1.0. A setting that the device does not have is fixed at HeadSettings' default.
///
/// Threading: thread-bound. Every call except limits() may take seconds.
class Controls {
 public:
  /// Finds the controls and switches off automatic modes.
  /// Errors: those of explain(), naming the control.
  static Result<Controls> find(const Device& device, std::int32_t gain_step_mdb);

  const HeadLimits& limits() const { return limits_; }
  /// The device's present settings.
  Result<HeadSettings> read(const Device& device) const;
  /// Sets values, which must be within limits(). After an error some of them may be set.
  Status set(const Device& device, const device::ControlChange& change) const;

 private:
  struct Range {
    std::uint32_t id = 0;
    std::int32_t low = 0, high = 0, step = 1, usual = 0;
    std::int32_t nearest(std::int64_t value) const;
  };
  static Result<std::optional<Range>> find_range(const Device& device, std::uint32_t id);

  HeadLimits limits_;
  std::int32_t gain_step_mdb_ = 0;
  std::optional<Range> exposure_, gain_, red_, blue_;
};

}  // namespace nodal::hal::v4l2
