// Video modes: which a camera has, and setting one.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <string>

#include "hal/linux/iidc/camera.h"
#include "hal/linux/iidc/registers.h"
#include "protocol/base/try.h"

namespace nodal::hal::iidc {
namespace {

constexpr int kFormat7 = 7;
constexpr int kPacketsPerSecond = 8000;  ///< the bus's cycles
constexpr int kLargestSide = 16384;      ///< px; width or height of a head's picture
constexpr int kMaxPolls = 1000;  ///< reads of the register until a value is set; each read is a request on the bus
constexpr std::uint32_t kIsoSpeed400 = 2U << 24;
constexpr std::uint32_t kIsoChannelBits = 0xF000'0000;

struct FixedMode {
  int format, number;
  PixelFormat pixels;
  int width, height;
};

/// Without those of YUV 4:4:4 and of 16 bits, which heads cannot have.
constexpr std::array kFixedModes{
    FixedMode{0, 1, PixelFormat::kUyvy, 320, 240},    FixedMode{0, 2, PixelFormat::kYuv411, 640, 480},
    FixedMode{0, 3, PixelFormat::kUyvy, 640, 480},    FixedMode{0, 4, PixelFormat::kRgb24, 640, 480},
    FixedMode{0, 5, PixelFormat::kGrey8, 640, 480},   FixedMode{1, 0, PixelFormat::kUyvy, 800, 600},
    FixedMode{1, 1, PixelFormat::kRgb24, 800, 600},   FixedMode{1, 2, PixelFormat::kGrey8, 800, 600},
    FixedMode{1, 3, PixelFormat::kUyvy, 1024, 768},   FixedMode{1, 4, PixelFormat::kRgb24, 1024, 768},
    FixedMode{1, 5, PixelFormat::kGrey8, 1024, 768},  FixedMode{2, 0, PixelFormat::kUyvy, 1280, 960},
    FixedMode{2, 1, PixelFormat::kRgb24, 1280, 960},  FixedMode{2, 2, PixelFormat::kGrey8, 1280, 960},
    FixedMode{2, 3, PixelFormat::kUyvy, 1600, 1200},  FixedMode{2, 4, PixelFormat::kRgb24, 1600, 1200},
    FixedMode{2, 5, PixelFormat::kGrey8, 1600, 1200},
};

/// By their numbers in the registers.
constexpr std::array<FrameRate, 8> kFixedRates{
    {{15, 8}, {15, 4}, {15, 2}, {15, 1}, {30, 1}, {60, 1}, {120, 1}, {240, 1}}};

/// Colour codings of format 7 that heads can have, by their numbers.
constexpr std::uint32_t kMono8 = 0, kYuv411 = 1, kYuv422 = 2, kRgb8 = 4, kRaw8 = 9;

std::optional<PixelFormat> pixels_of(std::uint32_t coding, std::uint32_t filter) {
  constexpr std::array kFilters{PixelFormat::kRggb8, PixelFormat::kGbrg8, PixelFormat::kGrbg8, PixelFormat::kBggr8};
  switch (coding) {
    case kMono8: return PixelFormat::kGrey8;
    case kYuv411: return PixelFormat::kYuv411;
    case kYuv422: return PixelFormat::kUyvy;
    case kRgb8: return PixelFormat::kRgb24;
    case kRaw8: return filter < kFilters.size() ? std::optional(kFilters[filter]) : std::nullopt;
    default: return std::nullopt;
  }
}

int high(std::uint32_t pair) { return static_cast<int>(pair >> 16); }
int low(std::uint32_t pair) { return static_cast<int>(pair & 0xFFFF); }
std::uint32_t pair_of(int high, int low) {
  return static_cast<std::uint32_t>(high) << 16 | (static_cast<std::uint32_t>(low) & 0xFFFF);
}
/// A number in the highest three bits.
std::uint32_t in_top(int number) { return static_cast<std::uint32_t>(number) << 29; }
constexpr std::uint32_t kTop = 7U << 29;

double hertz_of(FrameRate rate) { return static_cast<double>(rate.numerator) / rate.denominator; }

}  // namespace

Result<std::vector<Mode>> Camera::modes() {
  NODAL_TRY_ASSIGN(const auto formats, read(reg::kFormats, "reading its formats"));
  std::vector<Mode> modes;
  for (int format = 0; format < 3; ++format) {
    if ((formats & reg::bit(static_cast<unsigned>(format))) == 0) continue;
    NODAL_TRY(add_fixed_modes(format, modes));
  }
  if ((formats & reg::bit(kFormat7)) != 0) {
    NODAL_TRY(add_scalable_modes(modes));
  }
  return modes;
}

Status Camera::add_fixed_modes(int format, std::vector<Mode>& modes) {
  const auto format_4 = static_cast<std::uint32_t>(format) * 4;
  NODAL_TRY_ASSIGN(const auto present, read(reg::kModes + format_4, "reading its modes"));
  for (const FixedMode& fixed : kFixedModes) {
    if (fixed.format != format || (present & reg::bit(static_cast<unsigned>(fixed.number))) == 0) continue;
    NODAL_TRY_ASSIGN(const auto rates, read(reg::kRates + 8 * format_4 + 4 * static_cast<std::uint32_t>(fixed.number),
                                            "reading its rates"));
    Mode mode{fixed.format, fixed.number, fixed.pixels, fixed.width, fixed.height};
    for (unsigned i = 0; i < kFixedRates.size(); ++i) {
      if ((rates & reg::bit(i)) != 0) mode.rates.push_back(kFixedRates[i]);
    }
    if (!mode.rates.empty()) modes.push_back(std::move(mode));
  }
  return {};
}

Status Camera::add_scalable_modes(std::vector<Mode>& modes) {
  const std::string doing = "reading its modes of format 7";
  NODAL_TRY_ASSIGN(const auto present, read(reg::kModes + 4 * kFormat7, doing));
  for (unsigned number = 0; number < 8; ++number) {
    if ((present & reg::bit(number)) == 0) continue;
    NODAL_TRY_ASSIGN(const auto place, read(reg::kFormat7Places + 4 * number, doing));
    Mode mode{kFormat7, static_cast<int>(number)};
    mode.scalable = true;
    mode.place = std::uint64_t{place} * 4;
    std::array<std::uint32_t, 5> values{};
    constexpr std::array kOffsets{reg::kMaxSize, reg::kUnitSize, reg::kUnitPlace, reg::kCodings, reg::kColourFilter};
    for (std::size_t i = 0; i < values.size(); ++i) {
      const auto value = read_at(mode.place + kOffsets[i], doing);
      // Cameras of version 1.20 have no units of the place and no colour filter, and may refuse these registers.
      if (!value && (i < 2 || i == 3 || value.error().code == Errc::kDeviceGone)) return fail(value.error());
      values[i] = value ? *value : kOffsets[i] == reg::kColourFilter ? ~0U : 0;
    }
    mode.width = high(values[0]);
    mode.height = low(values[0]);
    mode.width_unit = std::max(high(values[1]), 1);
    mode.height_unit = std::max(low(values[1]), 1);
    mode.left_unit = high(values[2]) > 0 ? high(values[2]) : mode.width_unit;
    mode.top_unit = low(values[2]) > 0 ? low(values[2]) : mode.height_unit;
    if (std::min(mode.width, mode.height) < 1 || std::max(mode.width, mode.height) > kLargestSide) continue;
    for (mode.coding = 0; mode.coding <= kRaw8; ++mode.coding) {
      const auto pixels = pixels_of(mode.coding, values[4] >> 24);
      if (!pixels || (values[3] & reg::bit(mode.coding)) == 0) continue;
      mode.pixels = *pixels;
      modes.push_back(mode);
    }
  }
  return {};
}

Status Camera::set_mode(const Mode& mode) {
  const std::string doing = "setting its video mode";
  for (const auto& [offset, number] : {std::pair{reg::kFormat, mode.format}, std::pair{reg::kMode, mode.number}}) {
    NODAL_TRY(put(info().command_base + offset, in_top(number), kTop, doing));
  }
  if (info().usb) return {};
  // 400 Mbit/s, which every camera and controller has; the channel is chosen when the stream's buffers are made.
  NODAL_TRY_ASSIGN(const auto channel, read(reg::kIsoChannel, doing));
  return write(reg::kIsoChannel, (channel & kIsoChannelBits) | kIsoSpeed400, doing);
}

Result<Selected> Camera::select(const Selection& selection) {
  NODAL_TRY(set_mode(selection.mode));
  NODAL_TRY_ASSIGN(const auto selected, selection.mode.scalable ? select_scalable(selection) : select_fixed(selection));
  NODAL_TRY_ASSIGN(const auto functions, read(reg::kBasicFunctions, "setting its video mode"));
  if ((functions & reg::kHasModeError) == 0) return selected;
  NODAL_TRY_ASSIGN(const auto error, read(reg::kModeError, "setting its video mode"));
  if ((error & reg::kPresent) == 0) return selected;
  return fail(Errc::kUnsupported,
              "head '" + head_ + "': the camera refuses this combination of format, size and rate; choose another");
}

Result<Selected> Camera::select_fixed(const Selection& selection) {
  const auto rate = std::find(kFixedRates.begin(), kFixedRates.end(), selection.rate);
  NODAL_ASSERT(rate != kFixedRates.end());
  NODAL_TRY(put(info().command_base + reg::kRate, in_top(static_cast<int>(rate - kFixedRates.begin())), kTop,
                "setting its rate"));
  return Selected{packed_size(selection.mode.pixels, selection.width, selection.height), hertz_of(selection.rate)};
}

/// Since version 1.30 a camera takes over new values only when it is told to, and then says whether it can.
Status Camera::apply(const Mode& mode, std::uint32_t error_bit, const std::string& doing) {
  auto state = read_at(mode.place + reg::kValueSetting, doing);
  if (!state && state.error().code == Errc::kDeviceGone) return fail(state.error());
  if (!state || (*state & reg::kPresent) == 0) return {};
  if (error_bit == reg::kError1) {
    NODAL_TRY(write_at(mode.place + reg::kValueSetting, reg::kSetting1, doing));
    for (int i = 0; i < kMaxPolls; ++i) {
      state = read_at(mode.place + reg::kValueSetting, doing);
      if (!state) return fail(state.error());
      if ((*state & reg::kSetting1) == 0) break;
    }
  }
  if ((*state & (reg::kSetting1 | error_bit)) == 0) return {};
  return fail(Errc::kUnsupported, "head '" + head_ + "': " + doing +
                                      ": the camera refuses it; choose another size, offset or packet_bytes");
}

Result<Selected> Camera::select_scalable(const Selection& selection) {
  const Mode& mode = selection.mode;
  const std::string doing = "setting the size of its picture";
  struct Setting {
    std::uint32_t offset, value, mask;
  };
  // At the origin first, so that the new size fits wherever the old place was.
  for (const Setting& one : {Setting{reg::kCoding, mode.coding << 24, 0xFF00'0000}, Setting{reg::kPlace, 0, ~0U},
                             Setting{reg::kSize, pair_of(selection.width, selection.height), ~0U},
                             Setting{reg::kPlace, pair_of(selection.left, selection.top), ~0U}}) {
    NODAL_TRY(put(mode.place + one.offset, one.value, one.mask, doing));
  }
  NODAL_TRY(apply(mode, reg::kError1, doing));

  const std::string packets = "setting the size of its packets";
  NODAL_TRY_ASSIGN(const auto limits, read_at(mode.place + reg::kPacketLimits, packets));
  const auto unit = static_cast<std::uint32_t>(std::max(high(limits), 1));
  const auto most = static_cast<std::uint32_t>(low(limits));
  const std::size_t picture = packed_size(mode.pixels, selection.width, selection.height);
  const double least = static_cast<double>(picture) * hertz_of(selection.rate) / kPacketsPerSecond;
  const auto smallest = static_cast<std::uint32_t>(std::ceil(least / unit)) * unit;
  const std::uint32_t bytes = selection.packet_bytes > 0 ? selection.packet_bytes : std::max(smallest, unit);
  if (bytes > most || bytes % unit != 0) {
    return fail(Errc::kUnsupported,
                fmt::format("head '{}': the camera's packets have at most {} bytes, a multiple of {}; this size at "
                            "this rate needs {}; choose a smaller size, a lower rate or another packet_bytes",
                            head_, most, unit, bytes));
  }
  NODAL_TRY(put(mode.place + reg::kPacket, bytes << 16, 0xFFFF'0000, packets));
  NODAL_TRY(apply(mode, reg::kError2, packets));
  const auto packet_count = read_at(mode.place + reg::kPacketsPerFrame, packets);
  if (!packet_count && packet_count.error().code == Errc::kDeviceGone) return fail(packet_count.error());
  std::size_t count = packet_count ? *packet_count : 0;
  const std::size_t needed = (picture + bytes - 1) / bytes;
  if (count < needed || count > 2 * needed + kPacketsPerSecond) count = needed;
  Selected selected{count * bytes, static_cast<double>(kPacketsPerSecond) / static_cast<double>(count)};
  const auto interval = read_at(mode.place + reg::kFrameInterval, packets);
  if (!interval && interval.error().code == Errc::kDeviceGone) return fail(interval.error());
  const float seconds = interval ? std::bit_cast<float>(*interval) : 0.F;
  if (std::isfinite(seconds) && seconds > 1e-5F && seconds < 1e3F) selected.hertz = 1 / static_cast<double>(seconds);
  return selected;
}

}  // namespace nodal::hal::iidc
