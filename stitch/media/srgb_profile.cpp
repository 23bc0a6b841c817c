#include "stitch/media/srgb_profile.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <optional>
#include <string_view>

namespace nodal::media {
namespace {

using Bytes = std::span<const std::uint8_t>;

constexpr std::size_t kHeaderBytes = 128, kTagBytes = 12, kMaxTags = 100;
/// sRGB's red, green and blue as a profile has them: X, Y, Z relative to D50 (IEC 61966-2-1, adapted by Bradford's
/// matrix).
constexpr std::array<std::array<double, 3>, 3> kPrimaries{
    {{0.43607, 0.22249, 0.01392}, {0.38515, 0.71687, 0.09708}, {0.14307, 0.06061, 0.71410}}};
constexpr double kSamePrimary = 0.002;  // half a level in the middle of the range

double to_srgb(double light) {
  return light <= 0.0031308 ? 12.92 * light : 1.055 * std::pow(light, 1 / 2.4) - 0.055;  // IEC 61966-2-1
}

double number(Bytes bytes, std::size_t at, std::size_t count) {
  double value = 0;
  for (const std::uint8_t byte : bytes.subspan(at, count)) value = 256 * value + byte;
  return value;
}

/// A number of type s15Fixed16Number.
double fixed(Bytes bytes, std::size_t at) {
  const double value = number(bytes, at, 4);
  return (value >= 0x1p31 ? value - 0x1p32 : value) / 65536;
}

bool is_word(Bytes bytes, std::size_t at, std::string_view word) {
  return std::ranges::equal(bytes.subspan(at, word.size()), word,
                            [](std::uint8_t byte, char c) { return byte == static_cast<std::uint8_t>(c); });
}

/// The data of a tag; nothing if the profile does not have it.
std::optional<Bytes> tag_of(Bytes icc, std::string_view name) {
  const auto count = static_cast<std::size_t>(std::min<double>(number(icc, kHeaderBytes, 4), kMaxTags));
  for (std::size_t k = 0; k < count; ++k) {
    const std::size_t at = kHeaderBytes + 4 + k * kTagBytes;
    if (icc.size() < at + kTagBytes) return std::nullopt;
    if (!is_word(icc, at, name)) continue;
    const auto begin = static_cast<std::size_t>(number(icc, at + 4, 4));
    const auto length = static_cast<std::size_t>(number(icc, at + 8, 4));
    if (begin > icc.size() || length > icc.size() - begin) return std::nullopt;
    return icc.subspan(begin, length);
  }
  return std::nullopt;
}

/// The light of a sample of 0 .. 1 by a curve of type curveType.
std::optional<double> light_by_table(Bytes curve, double sample) {
  const auto count = static_cast<std::size_t>(number(curve, 8, 4));
  if (count == 0) return sample;
  if (count > (curve.size() - 12) / 2) return std::nullopt;
  if (count == 1) return std::pow(sample, number(curve, 12, 2) / 256);
  const double place = sample * static_cast<double>(count - 1);
  const std::size_t below = std::min(static_cast<std::size_t>(place), count - 2);
  const double part = place - static_cast<double>(below);
  const double low = number(curve, 12 + 2 * below, 2), high = number(curve, 14 + 2 * below, 2);
  return (low + part * (high - low)) / 65535;
}

/// By one of type parametricCurveType: (a x + b)^g + e from d on, below it c x + f.
std::optional<double> light_by_formula(Bytes curve, double sample) {
  constexpr std::array<std::size_t, 5> kNumbers{1, 3, 4, 5, 7};
  const auto kind = static_cast<std::size_t>(number(curve, 8, 2));
  if (kind >= kNumbers.size() || curve.size() < 12 + 4 * kNumbers[kind]) return std::nullopt;
  std::array<double, 7> p{1, 1, 0, 0, 0, 0, 0};  // g, a, b, c, d, e, f
  for (std::size_t k = 0; k < kNumbers[kind]; ++k) p[k] = fixed(curve, 12 + 4 * k);
  double begin = p[4], below = p[3] * sample + p[6], added = p[5];
  if (kind == 1 || kind == 2) {
    begin = p[1] == 0 ? 0 : -p[2] / p[1];
    below = added = kind == 2 ? p[3] : 0;
  }
  return sample >= begin ? std::pow(std::max(0.0, p[1] * sample + p[2]), p[0]) + added : below;
}

bool is_srgb_curve(std::optional<Bytes> curve) {
  constexpr int kSamples = 64;
  if (!curve || curve->size() < 12) return false;
  const bool table = is_word(*curve, 0, "curv");
  if (!table && !is_word(*curve, 0, "para")) return false;
  for (int k = 0; k <= kSamples; ++k) {
    const double sample = static_cast<double>(k) / kSamples;
    const std::optional<double> light = table ? light_by_table(*curve, sample) : light_by_formula(*curve, sample);
    if (!light || !(std::abs(to_srgb(std::clamp(*light, 0.0, 1.0)) - sample) < 1.0 / 255)) return false;
  }
  return true;
}

bool is_primary(std::optional<Bytes> colour, const std::array<double, 3>& right) {
  if (!colour || colour->size() < 20) return false;
  for (std::size_t k = 0; k < right.size(); ++k) {
    if (std::abs(fixed(*colour, 8 + 4 * k) - right[k]) > kSamePrimary) return false;
  }
  return true;
}

}  // namespace

bool is_srgb_profile(Bytes icc) {
  if (icc.size() < kHeaderBytes + 4 || !is_word(icc, 36, "acsp") || tag_of(icc, "A2B0")) return false;
  if (is_word(icc, 16, "GRAY")) return is_srgb_curve(tag_of(icc, "kTRC"));
  if (!is_word(icc, 16, "RGB ")) return false;
  constexpr std::array<std::string_view, 3> kColours{"rXYZ", "gXYZ", "bXYZ"}, kCurves{"rTRC", "gTRC", "bTRC"};
  for (std::size_t c = 0; c < kColours.size(); ++c) {
    if (!is_primary(tag_of(icc, kColours[c]), kPrimaries[c]) || !is_srgb_curve(tag_of(icc, kCurves[c]))) return false;
  }
  return true;
}

}  // namespace nodal::media
