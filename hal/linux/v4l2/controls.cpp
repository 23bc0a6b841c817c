#include "hal/linux/v4l2/controls.h"

#include <algorithm>
#include <cerrno>
#include <string>

#include "protocol/base/limits.h"
#include "protocol/base/try.h"

namespace nodal::hal::v4l2 {
namespace {

constexpr std::int64_t kExposureUnitUs = 100;
constexpr std::int64_t kLongestUs = 10'000'000;  ///< the same limit as in rig.toml
/// Frames from a control's change to the first frame with it; V4L2 does not report this, and most sensors need 2.
constexpr int kLatencyFrames = 2;

std::string name_of(std::uint32_t id) {
  switch (id) {
    case V4L2_CID_EXPOSURE_ABSOLUTE: return "the exposure";
    case V4L2_CID_GAIN:
    case V4L2_CID_ANALOGUE_GAIN: return "the gain";
    case V4L2_CID_RED_BALANCE: return "the red balance";
    case V4L2_CID_BLUE_BALANCE: return "the blue balance";
    case V4L2_CID_EXPOSURE_AUTO: return "automatic exposure off";
    case V4L2_CID_EXPOSURE_AUTO_PRIORITY: return "the rate's dependence on the exposure off";
    case V4L2_CID_AUTOGAIN: return "automatic gain off";
    case V4L2_CID_AUTO_WHITE_BALANCE: return "automatic white balance off";
    default: return "a control";
  }
}

Status set_one(const Device& device, std::uint32_t id, std::int32_t value) {
  v4l2_control control{id, value};
  if (const int error = device.ioctl(VIDIOC_S_CTRL, &control); error != 0) {
    return fail(device.explained("setting " + name_of(id), error));
  }
  return {};
}

/// The control's default value maps to 4096 (1.0).
std::uint16_t q12_of(std::int32_t value, std::int32_t usual) {
  return static_cast<std::uint16_t>(
      std::clamp<std::int64_t>((std::int64_t{value} * 4096 + usual / 2) / usual, 1, 65535));
}

}  // namespace

std::int32_t Controls::Range::nearest(std::int64_t value) const {
  value = std::clamp<std::int64_t>(value, low, high);
  const std::int64_t steps = (value - low + step / 2) / step;
  const std::int64_t rounded = low + steps * step;
  return static_cast<std::int32_t>(rounded > high ? rounded - step : rounded);
}

Result<std::optional<Controls::Range>> Controls::find_range(const Device& device, std::uint32_t id) {
  v4l2_queryctrl query{};
  query.id = id;
  const int error = device.ioctl(VIDIOC_QUERYCTRL, &query);
  if (error == ENODEV || error == EIO) return fail(device.explained("asking for " + name_of(id), error));
  constexpr std::uint32_t kNot = V4L2_CTRL_FLAG_DISABLED | V4L2_CTRL_FLAG_READ_ONLY;
  if (error != 0 || (query.flags & kNot) != 0 || query.minimum > query.maximum) return std::optional<Range>{};
  return std::optional<Range>(Range{id, query.minimum, query.maximum, std::max(query.step, 1), query.default_value});
}

Result<Controls> Controls::find(const Device& device, std::int32_t gain_step_mdb) {
  // Automatic modes are switched off first, because they make the manual controls inactive.
  struct Off {
    std::uint32_t id;
    std::int32_t value;
  };
  for (const Off& off : {Off{V4L2_CID_EXPOSURE_AUTO, V4L2_EXPOSURE_MANUAL}, Off{V4L2_CID_EXPOSURE_AUTO_PRIORITY, 0},
                         Off{V4L2_CID_AUTOGAIN, 0}, Off{V4L2_CID_AUTO_WHITE_BALANCE, 0}}) {
    NODAL_TRY_ASSIGN(const auto allowed, find_range(device, off.id));
    if (!allowed) continue;
    NODAL_TRY(set_one(device, off.id, off.value));
  }

  Controls controls;
  controls.gain_step_mdb_ = gain_step_mdb;
  const auto find_one = [&](std::uint32_t id, std::optional<Range>& range) -> Status {
    if (range) return {};
    NODAL_TRY_ASSIGN(auto found, find_range(device, id));
    range = found;
    return {};
  };
  for (const auto& [id, range] : {std::pair{std::uint32_t{V4L2_CID_EXPOSURE_ABSOLUTE}, &controls.exposure_},
                                  std::pair{std::uint32_t{V4L2_CID_GAIN}, &controls.gain_},
                                  std::pair{std::uint32_t{V4L2_CID_ANALOGUE_GAIN}, &controls.gain_},
                                  std::pair{std::uint32_t{V4L2_CID_RED_BALANCE}, &controls.red_},
                                  std::pair{std::uint32_t{V4L2_CID_BLUE_BALANCE}, &controls.blue_}}) {
    NODAL_TRY(find_one(id, *range));
  }
  if (gain_step_mdb <= 0) controls.gain_.reset();
  if (!controls.red_ || !controls.blue_ || controls.red_->usual <= 0 || controls.blue_->usual <= 0) {
    controls.red_.reset();
    controls.blue_.reset();
  }

  HeadLimits& limits = controls.limits_;
  limits.control_latency_frames = kLatencyFrames;
  const HeadSettings fixed;
  limits.exposure_min = limits.exposure_max = fixed.exposure;
  limits.gain_min = limits.gain_max = fixed.gain;
  if (const auto& range = controls.exposure_) {
    const auto exposure = [](std::int32_t units) {
      return Exposure::microseconds(
          std::clamp<std::int64_t>(std::max(units, 1) * kExposureUnitUs, kExposureUnitUs, kLongestUs));
    };
    limits.exposure_min = exposure(range->low);
    limits.exposure_max = exposure(range->high);
  }
  if (const auto& range = controls.gain_) {
    const auto gain = [&](std::int32_t steps) {
      return Gain::millidecibels(static_cast<std::int32_t>(
          std::clamp<std::int64_t>(std::int64_t{steps} * gain_step_mdb, -kMaxGainMdb, kMaxGainMdb)));
    };
    limits.gain_min = gain(range->low);
    limits.gain_max = gain(range->high);
  }
  limits.has_white_balance = controls.red_.has_value();
  return controls;
}

Result<HeadSettings> Controls::read(const Device& device) const {
  HeadSettings settings;
  const auto get = [&](const Range& range) -> Result<std::int32_t> {
    v4l2_control control{range.id, 0};
    if (const int error = device.ioctl(VIDIOC_G_CTRL, &control); error != 0) {
      return fail(device.explained("reading " + name_of(range.id), error));
    }
    return control.value;
  };
  if (exposure_) {
    NODAL_TRY_ASSIGN(const auto value, get(*exposure_));
    settings.exposure = Exposure::microseconds(value * kExposureUnitUs);
  }
  if (gain_) {
    NODAL_TRY_ASSIGN(const auto value, get(*gain_));
    settings.gain = Gain::millidecibels(static_cast<std::int32_t>(
        std::clamp<std::int64_t>(std::int64_t{value} * gain_step_mdb_, -kMaxGainMdb, kMaxGainMdb)));
  }
  if (red_) {
    NODAL_TRY_ASSIGN(const auto red, get(*red_));
    NODAL_TRY_ASSIGN(const auto blue, get(*blue_));
    settings.white_balance = {q12_of(red, red_->usual), q12_of(blue, blue_->usual)};
  }
  return settings;
}

Status Controls::set(const Device& device, const device::ControlChange& change) const {
  Status done;
  if (change.exposure && exposure_) {
    done = set_one(device, exposure_->id,
                   exposure_->nearest((change.exposure->us() + kExposureUnitUs / 2) / kExposureUnitUs));
  }
  if (done && change.gain && gain_) {
    const std::int64_t half = change.gain->mdb() < 0 ? -gain_step_mdb_ / 2 : gain_step_mdb_ / 2;
    done = set_one(device, gain_->id, gain_->nearest((change.gain->mdb() + half) / gain_step_mdb_));
  }
  if (done && change.white_balance && red_) {
    const auto value = [](std::uint16_t q12, const Range& range) {
      return range.nearest((std::int64_t{q12} * range.usual + 2048) / 4096);
    };
    done = set_one(device, red_->id, value(change.white_balance->red_q12, *red_));
    if (done) done = set_one(device, blue_->id, value(change.white_balance->blue_q12, *blue_));
  }
  return done;
}

}  // namespace nodal::hal::v4l2
