#include "stitch/timing/sinc.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numbers>

namespace nodal::timing {
namespace {

constexpr int kTaps = 32;  // samples that one value is made of
constexpr int kSteps = 256;
constexpr double kKaiserBeta = 7;

}  // namespace

double bessel_i0(double x) {
  double sum = 1, term = 1;
  for (int k = 1; term > 1e-12 * sum; ++k) {
    term *= (x / (2 * k)) * (x / (2 * k));
    sum += term;
  }
  return sum;
}

double kaiser(double x, double beta) {
  return std::abs(x) > 1 ? 0.0 : bessel_i0(beta * std::sqrt(1 - x * x)) / bessel_i0(beta);
}

SincTable::SincTable() {
  weights_.reserve((kSteps + 1) * kTaps);
  for (int step = 0; step <= kSteps; ++step) {
    for (int tap = 0; tap < kTaps; ++tap) {
      const double x = tap - (kTaps / 2 - 1) - static_cast<double>(step) / kSteps;
      const double sinc = x == 0 ? 1.0 : std::sin(std::numbers::pi * x) / (std::numbers::pi * x);
      weights_.push_back(sinc * kaiser(x / (kTaps / 2.0), kKaiserBeta));
    }
  }
}

template <class Sample>
double SincTable::sum(std::span<const Sample> samples, double place) const {
  const double whole = std::floor(place);
  if (!(whole > -kTaps) || !(whole < static_cast<double>(samples.size()) + kTaps)) return 0;
  const double step = (place - whole) * kSteps;
  const int row = std::min(static_cast<int>(step), kSteps - 1);
  const double part = step - row;
  const double* low = weights_.data() + static_cast<std::ptrdiff_t>(row) * kTaps;
  const double* high = low + kTaps;
  const auto first = static_cast<std::ptrdiff_t>(whole) - (kTaps / 2 - 1);
  const auto count = static_cast<std::ptrdiff_t>(samples.size());
  const auto from = std::max<std::ptrdiff_t>(0, -first), to = std::min<std::ptrdiff_t>(kTaps, count - first);
  double below = 0, above = 0;
  for (std::ptrdiff_t tap = from; tap < to; ++tap) {
    const double x = samples[static_cast<std::size_t>(first + tap)];
    below += low[tap] * x;
    above += high[tap] * x;
  }
  return below + part * (above - below);
}

double SincTable::value(std::span<const double> samples, double place) const { return sum(samples, place); }
double SincTable::value(std::span<const float> samples, double place) const { return sum(samples, place); }

}  // namespace nodal::timing
