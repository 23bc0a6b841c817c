#include "hal/linux/iidc/embedded.h"

#include <algorithm>

#include "hal/linux/iidc/registers.h"
#include "protocol/base/try.h"

namespace nodal::hal::iidc {
namespace {

constexpr std::uint32_t kGainInfo = 1U << 1, kShutterInfo = 1U << 2, kCounterInfo = 1U << 6, kAllInfo = 0x3FF;
constexpr std::size_t kInfoBytes = 3 * 4;
constexpr std::uint32_t kFixedBits = reg::kPresent | 0x00FF'F000;

}  // namespace

Result<bool> switch_on_embedded(Camera& camera) {
  const std::string doing = "switching on its frame counter";
  const auto now = camera.read(reg::kFrameInfo, doing);
  if (!now && now.error().code == Errc::kDeviceGone) return fail(now.error());
  if (!now || (*now & reg::kPresent) == 0) return false;  // other makers' cameras refuse the register
  constexpr std::uint32_t kWanted = kGainInfo | kShutterInfo | kCounterInfo;
  if (Status set = camera.write(reg::kFrameInfo, (*now & ~kAllInfo) | kWanted, doing); !set) {
    if (set.error().code == Errc::kDeviceGone) return fail(set.error());
    return false;
  }
  NODAL_TRY_ASSIGN(const auto then, camera.read(reg::kFrameInfo, doing));
  return (then & kAllInfo) == kWanted;
}

std::optional<EmbeddedInfo> take_embedded(std::span<std::uint8_t> picture, std::size_t row_bytes, std::size_t repeat) {
  if (row_bytes < kInfoBytes || picture.size() < repeat * row_bytes + kInfoBytes) return std::nullopt;
  const auto number = [&](std::size_t i) {
    std::uint32_t value = 0;
    for (std::size_t k = 0; k < 4; ++k) value = value << 8 | picture[4 * i + k];
    return value;
  };
  const EmbeddedInfo info{number(0) & reg::kTwelveBits, number(1) & reg::kTwelveBits, number(2),
                          (number(0) & kFixedBits) == reg::kPresent && (number(1) & kFixedBits) == reg::kPresent};
  std::copy_n(picture.begin() + static_cast<std::ptrdiff_t>(repeat * row_bytes), kInfoBytes, picture.begin());
  return info;
}

}  // namespace nodal::hal::iidc
