#include "tests/support/iidc_registers.h"

#include <algorithm>
#include <bit>
#include <cmath>

namespace nodal::test {
namespace {

constexpr std::uint32_t kHasIt = 0x8000'0000, kOnBit = 0x0200'0000, kAutoBit = 0x0100'0000, kAbsoluteBit = 0x4000'0000;

/// Units of the registers per unit of the absolute values: 10 us, 0.05 dB, 0.1 Hz.
float steps(unsigned feature) {
  return feature == IidcRegisters::kShutter ? 1e5F : feature == IidcRegisters::kGain ? 20.F : 10.F;
}
bool has_absolute(unsigned feature) {
  return feature == IidcRegisters::kShutter || feature == IidcRegisters::kGain || feature == IidcRegisters::kFrameRate;
}
std::uint32_t bits_of(float value) { return std::bit_cast<std::uint32_t>(value); }

}  // namespace

IidcRegisters::IidcRegisters() {
  set(0x000, 0);
  set(0x100, 0x8100'0000);  // formats 0 and 7
  set(0x180, 0x3400'0000);  // format 0: modes 2, 3, 5
  set(0x19C, 0x8000'0000);  // format 7: mode 0
  for (const std::uint32_t mode : {2U, 3U, 5U}) set(0x200 + 4 * mode, mode == 5 ? 0x3C00'0000 : 0x3800'0000);
  set(0x2E0, static_cast<std::uint32_t>(kFormat7 / 4));
  set(0x400, 0x4000'9000);  // video mode errors, power, one shot
  set(0x404, 0x5189'0000);  // auto exposure, white balance, shutter, gain, trigger, frame rate
  set(0x628, 0);
  set(0x600, 2U << 29);
  set(0x604, 5U << 29);
  set(0x608, 0);
  set(0x60C, 0x3000'0000);
  set(0x610, 0);
  set(0x614, kHasIt);
  set(0x62C, 0);
  set(0x12F8, kHasIt);

  const auto feature = [this](unsigned id, std::uint32_t abilities, std::uint32_t low, std::uint32_t high) {
    set(0x500 + 4 * id, kHasIt | abilities | low << 12 | high);
    set(0x800 + 4 * id, kHasIt | kOnBit | kAutoBit | (low + high) / 2);
  };
  constexpr std::uint32_t kAll = 0x0F00'0000;  // readout, switch, automatic, manual
  feature(kAutoExposure, kAll, 0, 1023);
  feature(kShutter, kAbsoluteBit | kAll, 10, 3010);
  feature(kGain, kAbsoluteBit | kAll, 0, 480);
  feature(kFrameRate, kAbsoluteBit | kAll, 10, 600);
  feature(kWhiteBalance, kAll, 1, 1023);
  set(0x80C, kHasIt | kOnBit | kAutoBit | 600U << 12 | 400);
  set(0x530, 0x8E81'C000);  // switch, polarity, source 0 and software; modes 0 and 1
  set(0x830, kHasIt);
  for (const unsigned id : {kShutter, kGain, kFrameRate}) {
    const std::uint64_t place = kAbsolute + 16 * id;
    set(0x700 + 4 * id, static_cast<std::uint32_t>(place / 4));
    const float low = id == kShutter ? kShutterLow : id == kGain ? 0.F : 1.F;
    const float high = id == kShutter ? kShutterHigh : id == kGain ? kGainHigh : 60.F;
    values_[place] = bits_of(low);
    values_[place + 4] = bits_of(high);
    write_absolute(id, (low + high) / 2);
  }

  set_format7(0x00, 96U << 16 | 64);
  set_format7(0x04, 8U << 16 | 2);
  set_format7(0x08, 0);
  set_format7(0x0C, 96U << 16 | 64);
  set_format7(0x10, 0);
  set_format7(0x14, 0xC040'0000);  // Mono8, YUV411, RAW8
  set_format7(0x40, 4U << 16 | 512);
  set_format7(0x44, 512U << 16 | 512);
  set_format7(0x4C, 2U << 16 | 2);
  set_format7(0x58, 2U << 24);  // GRBG
  set_format7(0x7C, kHasIt);
  write_format7(0x44, 512U << 16);
}

bool IidcRegisters::read(std::uint64_t offset, std::uint32_t& value) const {
  const auto found = values_.find(offset);
  if (found == values_.end()) return false;
  value = found->second;
  return true;
}

float IidcRegisters::absolute(unsigned feature) const {
  return std::bit_cast<float>(values_.at(kAbsolute + 16 * feature + 8));
}

void IidcRegisters::set_absolute_high(unsigned feature, float value) {
  values_[kAbsolute + 16 * feature + 4] = bits_of(value);
}

bool IidcRegisters::write(std::uint64_t offset, std::uint32_t value) {
  if (values_.find(offset) == values_.end()) return false;
  const std::uint64_t command = offset - kBase;
  if (command >= 0x800 && command < 0x840) {
    write_feature(static_cast<unsigned>(command - 0x800) / 4, value);
  } else if (offset >= kAbsolute && offset < kAbsolute + 16 * 16) {
    const auto feature = static_cast<unsigned>((offset - kAbsolute) / 16);
    const bool on = (get(0x800 + 4 * feature) & kAbsoluteBit) != 0;
    if ((offset - kAbsolute) % 16 == 8 && on) write_absolute(feature, std::bit_cast<float>(value));
  } else if (offset >= kFormat7 && offset < kFormat7 + 0x80) {
    write_format7(static_cast<std::uint32_t>(offset - kFormat7), value);
  } else if (command >= 0x600 || command == 0) {
    values_[offset] = command == 0x12F8 ? kHasIt | (value & 0x3FF) : value;
  }
  return true;
}

void IidcRegisters::write_feature(unsigned feature, std::uint32_t value) {
  const std::uint32_t inquiry = get(0x500 + 4 * feature);
  if (feature == 12) {
    set(0x830, kHasIt | (value & 0x03EF'0FFF));
    return;
  }
  if ((inquiry & kAbsoluteBit) == 0) value &= ~kAbsoluteBit;
  const bool numbers = (value & (kAutoBit | kAbsoluteBit)) == 0;
  const std::uint32_t now = get(0x800 + 4 * feature);
  std::uint32_t low_12 = (numbers ? value : now) & 0xFFF;
  low_12 = std::clamp(low_12, inquiry >> 12 & 0xFFF, inquiry & 0xFFF);
  const std::uint32_t high_12 = feature == kWhiteBalance ? (numbers ? value : now) & 0xFF'F000 : 0;
  set(0x800 + 4 * feature, kHasIt | (value & (kAbsoluteBit | kOnBit | kAutoBit)) | high_12 | low_12);
  if (has_absolute(feature) && numbers) {
    values_[kAbsolute + 16 * feature + 8] = bits_of(static_cast<float>(low_12) / steps(feature));
  }
}

void IidcRegisters::write_absolute(unsigned feature, float value) {
  const std::uint64_t place = kAbsolute + 16 * feature;
  const float inside =
      std::clamp(value, std::bit_cast<float>(values_[place]), std::bit_cast<float>(values_[place + 4]));
  values_[place + 8] = bits_of(inside);
  const auto low_12 = static_cast<std::uint32_t>(std::lround(inside * steps(feature)));
  set(0x800 + 4 * feature, (get(0x800 + 4 * feature) & ~0xFFFU) | low_12);
}

void IidcRegisters::write_format7(std::uint32_t offset, std::uint32_t value) {
  if (offset != 0x08 && offset != 0x0C && offset != 0x10 && offset != 0x44 && offset != 0x7C) return;
  if (offset == 0x7C) value = kHasIt | format7_errors_;  // at once
  set_format7(offset, value);
  const std::uint32_t packet = std::max(format7(0x44) >> 16, 1U);
  set_format7(0x44, packet << 16 | 512);
  const std::uint32_t pixels = (format7(0x0C) >> 16) * (format7(0x0C) & 0xFFFF);
  const std::uint32_t bytes = format7(0x10) >> 24 == 1 ? pixels * 3 / 2 : pixels;
  set_format7(0x48, (bytes + packet - 1) / packet);
}

std::uint32_t IidcRegisters::width() const { return scalable() ? format7(0x0C) >> 16 : 640; }
std::uint32_t IidcRegisters::height() const { return scalable() ? format7(0x0C) & 0xFFFF : 480; }

std::uint32_t IidcRegisters::picture_bytes() const {
  const std::uint32_t pixels = width() * height();
  if (scalable()) return format7(0x10) >> 24 == 1 ? pixels * 3 / 2 : pixels;
  const std::uint32_t mode = get(0x604) >> 29;
  return mode == 2 ? pixels * 3 / 2 : mode == 3 ? pixels * 2 : pixels;
}

double IidcRegisters::hertz() const {
  const double bus = scalable() ? 8000.0 / format7(0x48) : 1.875 * (1U << (get(0x600) >> 29));
  const std::uint32_t feature = get(0x500 + 4 * kFrameRate) & get(0x800 + 4 * kFrameRate);
  const bool manual = (feature & kHasIt) != 0 && (get(0x800 + 4 * kFrameRate) & (kOnBit | kAutoBit)) == kOnBit;
  return manual ? std::min(bus, static_cast<double>(absolute(kFrameRate))) : bus;
}

}  // namespace nodal::test
