#include "hal/linux/iidc/controls.h"

#include <algorithm>
#include <cmath>

#include "protocol/base/limits.h"
#include "protocol/base/try.h"

namespace nodal::hal::iidc {
namespace {

constexpr double kLongestUs = 10'000'000;  ///< the same limit as in rig.toml
/// Frames from a register's change to the first frame with it. IIDC does not define this; most sensors need 2.
constexpr int kLatencyFrames = 2;

/// Absolute values are 32-bit floats, which hold microseconds up to 10 s exactly enough to round to them.
Exposure exposure_in(float seconds) {
  const double us = std::round(static_cast<double>(seconds) * 1e6);
  return Exposure::microseconds(std::isfinite(us) ? static_cast<std::int64_t>(std::clamp(us, 1.0, kLongestUs)) : 1);
}

Gain gain_of_decibels(double decibels) {
  const double mdb = std::round(decibels * 1000);
  constexpr double kMax = kMaxGainMdb;
  return Gain::millidecibels(std::isfinite(mdb) ? static_cast<std::int32_t>(std::clamp(mdb, -kMax, kMax)) : 0);
}

std::uint32_t middle_of(const Feature& feature) { return std::max((feature.low + feature.high + 1) / 2, 1U); }

/// The middle of the range maps to 4096 (1.0).
std::uint16_t q12_of(std::uint32_t value, const Feature& range) {
  const std::uint32_t middle = middle_of(range);
  return static_cast<std::uint16_t>(
      std::clamp<std::uint64_t>((std::uint64_t{value} * 4096 + middle / 2) / middle, 1, 65535));
}

std::uint32_t value_of(std::uint16_t q12, const Feature& range) {
  const std::uint64_t value = (std::uint64_t{q12} * middle_of(range) + 2048) / 4096;
  return static_cast<std::uint32_t>(std::clamp<std::uint64_t>(value, range.low, range.high));
}

}  // namespace

Gain Controls::gain_in(const Feature& feature) const {
  return feature.absolute ? gain_of_decibels(feature.absolute_value)
                          : gain_of_decibels(static_cast<double>(feature.value) * gain_step_mdb_ / 1000);
}

Result<std::unique_ptr<Controls>> Controls::find(Camera& camera, const HeadRequest& request) {
  std::array<Feature, 3> found;
  constexpr std::array kIds{FeatureId::kShutter, FeatureId::kGain, FeatureId::kWhiteBalance};
  for (std::size_t i = 0; i < kIds.size(); ++i) {
    NODAL_TRY_ASSIGN(const auto feature, camera.feature(kIds[i]));
    found[i] = feature;
    if (!feature.present) continue;
    NODAL_TRY(camera.set_manual(kIds[i]));
  }
  // These change what the others do.
  for (const FeatureId id : {FeatureId::kAutoExposure, FeatureId::kBrightness}) {
    NODAL_TRY_ASSIGN(const auto feature, camera.feature(id));
    if (!feature.present) continue;
    Status set;
    if (feature.has_auto) set = camera.set_manual(id);
    if (set && id == FeatureId::kAutoExposure && feature.can_switch) set = camera.switch_off(id);
    if (!set) return fail(set.error());
  }
  auto controls = std::unique_ptr<Controls>(new Controls());
  HeadLimits& limits = controls->limits_;
  limits.control_latency_frames = kLatencyFrames;
  const HeadSettings fixed;
  limits.exposure_min = limits.exposure_max = fixed.exposure;
  limits.gain_min = limits.gain_max = fixed.gain;
  controls->gain_step_mdb_ = request.gain_step_mdb;
  if (request.trigger.pulse_width) {
    controls->by_pulse_ = Exposure::of(request.pulse_width);
    limits.exposure_min = limits.exposure_max = *controls->by_pulse_;
  }
  if (const Feature& shutter = found[0]; shutter.present && shutter.absolute) {
    controls->shutter_ = shutter;
  }
  if (controls->shutter_ && !controls->by_pulse_) {
    const Feature& shutter = *controls->shutter_;
    limits.exposure_min = exposure_in(shutter.absolute_low);
    limits.exposure_max = std::max(exposure_in(shutter.absolute_high), limits.exposure_min);
  }
  if (Feature gain = found[1]; gain.present && (gain.absolute || request.gain_step_mdb > 0)) {
    controls->gain_ = gain;
    gain.absolute_value = gain.absolute_low;
    gain.value = gain.low;
    limits.gain_min = controls->gain_in(gain);
    gain.absolute_value = gain.absolute_high;
    gain.value = gain.high;
    limits.gain_max = std::max(controls->gain_in(gain), limits.gain_min);
  }
  if (found[2].present && found[2].high > found[2].low) controls->balance_ = found[2];
  limits.has_white_balance = controls->balance_.has_value();
  NODAL_TRY_ASSIGN(const auto trigger, camera.trigger());
  limits.has_trigger_input = request.trigger.pulse_width ? trigger.pulse_width : trigger.edge;
  return controls;
}

Result<HeadSettings> Controls::read(Camera& camera) {
  HeadSettings settings;
  if (by_pulse_ && triggered_) {
    settings.exposure = *by_pulse_;
  } else if (shutter_) {
    NODAL_TRY_ASSIGN(const auto now, camera.feature(FeatureId::kShutter));
    settings.exposure = exposure_in(now.absolute_value);
    shutters_.add(now.value, settings.exposure);
  }
  if (gain_) {
    NODAL_TRY_ASSIGN(const auto now, camera.feature(FeatureId::kGain));
    settings.gain = gain_in(now);
    gains_.add(now.value, settings.gain);
  }
  if (balance_) {
    NODAL_TRY_ASSIGN(const auto now, camera.feature(FeatureId::kWhiteBalance));
    settings.white_balance = {q12_of(now.value, *balance_), q12_of(now.blue, *balance_)};
  }
  return settings;
}

Status Controls::set(Camera& camera, const device::ControlChange& change) {
  Status done;
  if (change.exposure && shutter_ && !by_pulse_) {
    const double seconds = static_cast<double>(change.exposure->duration().ns()) / 1e9;
    done = camera.set_absolute(FeatureId::kShutter, static_cast<float>(seconds));
  }
  if (done && change.gain && gain_) {
    if (gain_->absolute) {
      done = camera.set_absolute(FeatureId::kGain, static_cast<float>(change.gain->mdb()) / 1000);
    } else {
      const double steps = std::round(static_cast<double>(change.gain->mdb()) / gain_step_mdb_);
      done = camera.set_value(FeatureId::kGain,
                              static_cast<std::uint32_t>(std::clamp<double>(steps, gain_->low, gain_->high)));
    }
  }
  if (done && change.white_balance && balance_) {
    done = camera.set_white_balance(value_of(change.white_balance->blue_q12, *balance_),
                                    value_of(change.white_balance->red_q12, *balance_));
  }
  return done;
}

}  // namespace nodal::hal::iidc
