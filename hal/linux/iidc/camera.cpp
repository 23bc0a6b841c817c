#include "hal/linux/iidc/camera.h"

#include <fmt/format.h>

#include <array>
#include <bit>
#include <cerrno>
#include <cstdio>
#include <cstring>

#include "hal/linux/iidc/registers.h"
#include "protocol/base/try.h"

namespace nodal::hal::iidc {
namespace {

std::string name_of(FeatureId id) {
  switch (id) {
    case FeatureId::kBrightness: return "the brightness";
    case FeatureId::kAutoExposure: return "the automatic exposure";
    case FeatureId::kWhiteBalance: return "the white balance";
    case FeatureId::kShutter: return "the shutter";
    case FeatureId::kGain: return "the gain";
    case FeatureId::kFrameRate: return "the frame rate";
  }
  return "a feature";
}

std::uint32_t in_table(std::uint32_t table, FeatureId id) { return table + 4 * static_cast<std::uint32_t>(id); }

std::string hex(std::uint32_t value) {
  std::array<char, 16> text{};
  std::snprintf(text.data(), text.size(), "%08Xh", value);
  return text.data();
}

}  // namespace

std::string port_of(std::uint64_t guid) {
  std::array<char, 32> text{};
  std::snprintf(text.data(), text.size(), "iidc:%016llx", static_cast<unsigned long long>(guid));
  return text.data();
}

Error explain(const std::string& head, const std::string& doing, int error) {
  const auto because = [&](Errc code, const std::string& reason) {
    return Error{code, "head '" + head + "': " + doing + ": " + reason};
  };
  switch (error) {
    case ENODEV: return because(Errc::kDeviceGone, "the camera is not there any more; plug it in again");
    case EBUSY: return because(Errc::kBusy, "another program uses the camera; end that program");
    case EACCES:
      return because(Errc::kDeviceFailed,
                     "no permission; make nodald's user a member of group video (60-nodal.rules gives it the devices)");
    case ENOSPC:
      return because(Errc::kBandwidth,
                     "the bus has no room for it; choose a smaller size or a lower rate, or plug it "
                     "into another bus");
    case ENOMEM:
      return because(Errc::kDeviceFailed,
                     "the system has no memory for it; for USB cameras raise usbcore.usbfs_memory_mb");
    case EIO:
      return because(Errc::kDeviceFailed,
                     "the camera refuses or does not answer; if this goes on, unplug it and plug it in again");
    default: return because(Errc::kDeviceFailed, std::strerror(error));
  }
}

Result<std::uint32_t> Camera::read_at(std::uint64_t offset, const std::string& doing) {
  std::uint32_t value = 0;
  if (const int error = device_->read(offset, value); error != 0) return fail(explained(doing, error));
  return value;
}

Status Camera::write_at(std::uint64_t offset, std::uint32_t value, const std::string& doing) {
  if (const int error = device_->write(offset, value); error != 0) return fail(explained(doing, error));
  return {};
}

Status Camera::put(std::uint64_t offset, std::uint32_t value, std::uint32_t mask, const std::string& doing) {
  NODAL_TRY(write_at(offset, value, doing));
  NODAL_TRY_ASSIGN(const auto now, read_at(offset, doing));
  if ((now & mask) == (value & mask)) return {};
  return fail(Errc::kDeviceFailed, "head '" + head_ + "': " + doing +
                                       ": the camera does not accept it: its register is " + hex(now) + " after " +
                                       hex(value) + " was written");
}

Status Camera::prepare() {
  NODAL_TRY_ASSIGN(const auto functions, read(reg::kBasicFunctions, "reading its functions"));
  if ((functions & reg::kHasPower) != 0) {
    NODAL_TRY(write(reg::kPower, reg::kPresent, "switching it on"));
  }
  return transmit(false);
}

Status Camera::transmit(bool on) {
  return put(info().command_base + reg::kTransmit, on ? reg::kPresent : 0, reg::kPresent,
             on ? "starting its stream" : "stopping its stream");
}

Result<std::uint64_t> Camera::absolute_place(FeatureId id) {
  NODAL_TRY_ASSIGN(const auto place, read(in_table(reg::kAbsolutePlaces, id), "reading " + name_of(id)));
  return std::uint64_t{place} * 4;
}

Result<Feature> Camera::feature(FeatureId id) {
  const std::string doing = "reading " + name_of(id);
  NODAL_TRY_ASSIGN(const auto all, read(reg::kFeaturesPresent, doing));
  Feature feature;
  if ((all & reg::bit(static_cast<unsigned>(id))) == 0) return feature;
  NODAL_TRY_ASSIGN(const auto inquiry, read(in_table(reg::kFeatureInquiries, id), doing));
  NODAL_TRY_ASSIGN(const auto now, read(in_table(reg::kFeatures, id), doing));
  feature.present = (inquiry & reg::kPresent) != 0;
  feature.can_switch = (inquiry & reg::kCanSwitch) != 0;
  feature.has_auto = (inquiry & reg::kCanAutomatic) != 0;
  feature.absolute = (inquiry & reg::kAbsolute) != 0;
  feature.low = inquiry >> 12 & reg::kTwelveBits;
  feature.high = inquiry & reg::kTwelveBits;
  feature.value = now & reg::kTwelveBits;
  feature.blue = now >> 12 & reg::kTwelveBits;
  if (!feature.present || !feature.absolute) return feature;
  NODAL_TRY_ASSIGN(const auto place, absolute_place(id));
  for (const auto& [offset, value] :
       {std::pair{reg::kAbsoluteLow, &feature.absolute_low}, std::pair{reg::kAbsoluteHigh, &feature.absolute_high},
        std::pair{reg::kAbsoluteValue, &feature.absolute_value}}) {
    NODAL_TRY_ASSIGN(const auto bits, read_at(place + offset, doing));
    *value = std::bit_cast<float>(bits);
  }
  return feature;
}

Status Camera::set_manual(FeatureId id) {
  NODAL_TRY_ASSIGN(const auto found, feature(id));
  const std::string doing = "setting " + name_of(id) + " to manual";
  NODAL_TRY_ASSIGN(const auto now, read(in_table(reg::kFeatures, id), doing));
  std::uint32_t mask = 0;
  if (found.has_auto) mask |= reg::kAutomatic;
  if (found.can_switch) mask |= reg::kOn;
  if (found.absolute) mask |= reg::kAbsolute;
  const std::uint32_t wanted =
      (now & ~reg::kAutomatic) | reg::kPresent | reg::kOn | (found.absolute ? reg::kAbsolute : 0);
  return put(info().command_base + in_table(reg::kFeatures, id), wanted, mask, doing);
}

Status Camera::switch_off(FeatureId id) {
  const std::string doing = "switching off " + name_of(id);
  NODAL_TRY_ASSIGN(const auto now, read(in_table(reg::kFeatures, id), doing));
  return put(info().command_base + in_table(reg::kFeatures, id), now & ~reg::kOn, reg::kOn, doing);
}

Status Camera::set_value(FeatureId id, std::uint32_t value) {
  const std::string doing = "setting " + name_of(id);
  NODAL_TRY_ASSIGN(const auto now, read(in_table(reg::kFeatures, id), doing));
  return write(in_table(reg::kFeatures, id), (now & ~reg::kTwelveBits) | (value & reg::kTwelveBits), doing);
}

Status Camera::set_absolute(FeatureId id, float value) {
  NODAL_TRY_ASSIGN(const auto place, absolute_place(id));
  return write_at(place + reg::kAbsoluteValue, std::bit_cast<std::uint32_t>(value), "setting " + name_of(id));
}

Status Camera::set_white_balance(std::uint32_t blue, std::uint32_t red) {
  NODAL_TRY_ASSIGN(const auto now,
                   read(in_table(reg::kFeatures, FeatureId::kWhiteBalance), "setting the white balance"));
  const std::uint32_t values = (blue & reg::kTwelveBits) << 12 | (red & reg::kTwelveBits);
  return write(in_table(reg::kFeatures, FeatureId::kWhiteBalance), (now & 0xFF00'0000) | values,
               "setting the white balance");
}

Result<TriggerAbility> Camera::trigger() {
  NODAL_TRY_ASSIGN(const auto all, read(reg::kFeaturesPresent, "reading its trigger"));
  TriggerAbility ability;
  if ((all & reg::bit(reg::kTriggerFeature)) == 0) return ability;
  NODAL_TRY_ASSIGN(const auto inquiry, read(reg::kFeatureInquiries + 4 * reg::kTriggerFeature, "reading its trigger"));
  if ((inquiry & reg::kPresent) == 0) return ability;
  ability.edge = (inquiry & reg::kCanMode0) != 0;
  ability.pulse_width = (inquiry & reg::kCanMode1) != 0;
  return ability;
}

Status Camera::set_trigger(const std::optional<TriggerChoice>& choice) {
  const std::string doing = choice ? "setting its trigger" : "switching off its trigger";
  NODAL_TRY_ASSIGN(const auto ability, trigger());
  const bool present = ability.edge || ability.pulse_width;
  if (!choice && !present) return {};
  NODAL_TRY_ASSIGN(const auto inquiry, read(reg::kFeatureInquiries + 4 * reg::kTriggerFeature, doing));
  NODAL_TRY_ASSIGN(const auto now, read(reg::kFeatures + 4 * reg::kTriggerFeature, doing));
  const std::uint64_t at = info().command_base + reg::kFeatures + 4 * reg::kTriggerFeature;
  if (!choice) return put(at, now & ~reg::kOn, reg::kOn, doing);
  if (!(choice->pulse_width ? ability.pulse_width : ability.edge)) {
    return fail(Errc::kUnsupported,
                "head '" + head_ + "': the camera has no trigger mode " +
                    (choice->pulse_width ? "1 (the pulse is the exposure)" : "0 (an edge starts it)"));
  }
  // Where the polarity cannot be set, the bit that is read says what the camera has, and a request for another would
  // expose at the wrong edge.
  const std::uint32_t polarity = choice->active_high ? reg::kActiveHigh : 0;
  if ((inquiry & reg::kCanPolarity) == 0 && (now & reg::kActiveHigh) != polarity) {
    return fail(Errc::kUnsupported, std::string("head '") + head_ + "': its trigger input is active " +
                                        (choice->active_high ? "low" : "high") +
                                        " and cannot be changed; set polarity in [trigger]");
  }
  const std::uint32_t wanted =
      reg::kPresent | reg::kOn | polarity | (choice->pulse_width ? 1U : 0U) << reg::kTriggerModeShift;
  return put(at, wanted, reg::kOn | reg::kActiveHigh | reg::kTriggerModeBits, doing);
}

Result<std::unique_ptr<FrameSource>> Camera::make_source(int buffers, std::size_t frame_bytes) {
  std::unique_ptr<FrameSource> source;
  const int error = device_->make_source(static_cast<std::size_t>(buffers), frame_bytes, source);
  if (error != 0) return fail(explained(fmt::format("asking for {} buffers", buffers), error));
  return source;
}

}  // namespace nodal::hal::iidc
