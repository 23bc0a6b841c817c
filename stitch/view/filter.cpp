#include "stitch/view/filter.h"

#include <cmath>
#include <numbers>
#include <string>

namespace nodal::view {
namespace {

/// The weight of a pixel at the distance t, px.
double weight(Filter filter, double t) {
  t = std::abs(t);
  switch (filter) {
    case Filter::kNearest: return 1;
    case Filter::kBilinear: return t < 1 ? 1 - t : 0;
    case Filter::kBicubic: return t < 1 ? (1.5 * t - 2.5) * t * t + 1 : t < 2 ? ((-0.5 * t + 2.5) * t - 4) * t + 2 : 0;
    case Filter::kLanczos: {
      const double a = std::numbers::pi * t;
      return t < 1e-9 ? 1 : t < 3 ? 3 * std::sin(a) * std::sin(a / 3) / (a * a) : 0;
    }
  }
  return 0;
}

/// Weights in whole numbers that sum to `one`: the largest takes the rest.
template <class Weight>
void round_to_sum(const std::array<double, 8>& exact, double sum, int count, int one, std::array<Weight, 8>& phase) {
  int rest = one;
  std::size_t largest = 0;
  for (std::size_t k = 0; k < static_cast<std::size_t>(count); ++k) {
    phase[k] = static_cast<Weight>(std::lround(exact[k] / sum * one));
    rest -= phase[k];
    if (phase[k] > phase[largest]) largest = k;
  }
  phase[largest] = static_cast<Weight>(phase[largest] + rest);
}

Taps taps_of(Filter filter) {
  Taps taps;
  taps.count = filter == Filter::kNearest ? 1 : filter == Filter::kBilinear ? 2 : filter == Filter::kBicubic ? 4 : 6;
  taps.before = (taps.count - 1) / 2;
  for (int p = 0; p < Taps::kPhases; ++p) {
    std::array<double, 8> exact{};
    double sum = 0;
    for (int k = 0; k < taps.count; ++k) {
      exact[static_cast<std::size_t>(k)] = weight(filter, k - taps.before - static_cast<double>(p) / Taps::kPhases);
      sum += exact[static_cast<std::size_t>(k)];
    }
    round_to_sum(exact, sum, taps.count, Taps::kOne, taps.phases[static_cast<std::size_t>(p)]);
    round_to_sum(exact, sum, taps.count, Taps::kFineOne, taps.fine[static_cast<std::size_t>(p)]);
  }
  return taps;
}

}  // namespace

Result<Filter> parse_filter(std::string_view text) {
  if (text == "nearest") return Filter::kNearest;
  if (text == "bilinear") return Filter::kBilinear;
  if (text == "bicubic") return Filter::kBicubic;
  if (text == "lanczos") return Filter::kLanczos;
  return fail(Errc::kBadValue, "no filter is called '" + std::string(text.substr(0, 64)) +
                                   "'; there are: nearest, bilinear, bicubic, lanczos");
}

const Taps& Taps::of(Filter filter) {
  static const std::array kTaps{taps_of(Filter::kNearest), taps_of(Filter::kBilinear), taps_of(Filter::kBicubic),
                                taps_of(Filter::kLanczos)};
  return kTaps[static_cast<std::size_t>(filter)];
}

}  // namespace nodal::view
