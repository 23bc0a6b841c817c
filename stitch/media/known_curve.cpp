#include "stitch/media/known_curve.h"

#include <algorithm>
#include <cmath>

namespace nodal::media {
namespace {

constexpr double kLevel = 1.0 / 255;
constexpr double kMinGamma = 0.5, kMaxGamma = 4;

double srgb_of(double light) {
  return light <= 0.0031308 ? 12.92 * light : 1.055 * std::pow(light, 1 / 2.4) - 0.055;  // IEC 61966-2-1
}

/// Whether encode(light) gives every sample back, to within a level and the rounding of the table.
template <class Encode>
bool fits(std::span<const std::uint16_t> table, const Encode& encode) {
  const auto last = static_cast<double>(table.size() - 1);
  for (std::size_t k = 0; k < table.size(); ++k) {
    const double sample = static_cast<double>(k) / last;
    if (sample < encode(std::max(0.0, (table[k] - 0.5) / 65535)) - kLevel) return false;
    if (sample > encode(std::min(1.0, (table[k] + 0.5) / 65535)) + kLevel) return false;
  }
  return true;
}

}  // namespace

bool is_srgb_primaries(const std::array<double, 8>& xy) {
  constexpr std::array<double, 8> kSrgb{0.3127, 0.3290, 0.64, 0.33, 0.30, 0.60, 0.15, 0.06};
  constexpr double kSame = 0.002;
  for (std::size_t k = 0; k < xy.size(); ++k) {
    if (!(std::abs(xy[k] - kSrgb[k]) <= kSame)) return false;
  }
  return true;
}

std::optional<SampleMeaning> known_curve(std::span<const std::uint16_t> table) {
  if (table.size() < 2) return std::nullopt;
  if (fits(table, srgb_of)) return SampleMeaning::srgb();
  const std::size_t middle = table.size() / 2;
  const double sample = static_cast<double>(middle) / static_cast<double>(table.size() - 1);
  const double light = table[middle] / 65535.0;
  if (light <= 0 || light >= 1 || sample >= 1) return std::nullopt;
  double gamma = std::log(light) / std::log(sample);
  if (!(gamma >= kMinGamma && gamma <= kMaxGamma)) return std::nullopt;
  constexpr double kSameGamma = 0.005;  // what rounding of the table's middle can change
  if (std::abs(gamma - 1) < kSameGamma) gamma = 1;
  if (!fits(table, [gamma](double l) { return std::pow(l, 1 / gamma); })) return std::nullopt;
  return SampleMeaning{.curve = SampleMeaning::Curve::kGamma, .gamma = gamma};
}

}  // namespace nodal::media
