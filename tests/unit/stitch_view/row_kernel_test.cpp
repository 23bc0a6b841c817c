// Filters' taps, and the kernels that apply them along a row.
#include "stitch/view/row_kernel.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <random>
#include <string>
#include <vector>

namespace nodal::view {
namespace {

constexpr std::array kFilters{Filter::kNearest, Filter::kBilinear, Filter::kBicubic, Filter::kLanczos};

TEST(Taps, EveryPhase_SumsToOne) {
  for (const Filter filter : kFilters) {
    for (const auto& phase : Taps::of(filter).phases) {
      int sum = 0;
      for (const int weight : phase) sum += weight;
      EXPECT_EQ(sum, Taps::kOne);
    }
  }
}

TEST(Taps, OfAStraightLineAndAParabola_GiveTheFunction) {
  // Bilinear taps reproduce polynomials of degree 1, Catmull and Rom's of degree 2; to the rounding of the weights.
  for (const auto& [filter, degree] : {std::pair(Filter::kBilinear, 1), std::pair(Filter::kBicubic, 2)}) {
    const Taps& taps = Taps::of(filter);
    for (int p = 0; p < Taps::kPhases; ++p) {
      double sum = 0;
      for (int k = 0; k < taps.count; ++k) {
        sum +=
            taps.phases[static_cast<std::size_t>(p)][static_cast<std::size_t>(k)] * std::pow(k - taps.before, degree);
      }
      EXPECT_NEAR(sum / Taps::kOne, std::pow(p / 256.0, degree), 4e-4) << p;
    }
  }
}

TEST(Taps, LanczosHalfWay_AreTheSincsOfTheDefinition) {
  const Taps& taps = Taps::of(Filter::kLanczos);
  const auto sinc = [](double t) { return std::sin(std::numbers::pi * t) / (std::numbers::pi * t); };
  double sum = 0;
  for (const double t : {2.5, 1.5, 0.5}) sum += 2 * sinc(t) * sinc(t / 3);
  for (std::size_t k = 0; k < 6; ++k) {
    const double t = static_cast<double>(k) - 2.5;
    EXPECT_NEAR(taps.phases[128][k] / static_cast<double>(Taps::kOne), sinc(t) * sinc(t / 3) / sum, 1e-4) << k;
  }
}

struct Picture {
  int side = 64;
  std::vector<std::uint8_t> bytes;
};

/// Noise, or only black and white: the largest sums.
Picture picture_of(int channels, bool extreme, std::mt19937& random) {
  Picture picture;
  picture.bytes.resize(static_cast<std::size_t>(64 * 64 * channels));
  for (auto& byte : picture.bytes) {
    byte = static_cast<std::uint8_t>(extreme ? (random() % 2 == 0 ? 255 : 0) : random() % 256);
  }
  return picture;
}

Curve any_curve(std::mt19937& random) {
  const auto within = [&](double a, double b) {
    return static_cast<std::int32_t>(std::lround(std::ldexp(std::uniform_real_distribution<double>(a, b)(random), 18)));
  };
  return {within(-8, 8), within(-1, 1), within(-0.05, 0.05), within(-8, 8), within(-1, 1), within(-0.05, 0.05)};
}

TEST(RowKernel, AnyCurve_IsTheConvolutionWithTheTaps_WithinHalfALevel) {
  std::mt19937 random(3);
  for (const Filter filter : kFilters) {
    const Taps& taps = Taps::of(filter);
    for (int trial = 0; trial < 200; ++trial) {
      const Picture picture = picture_of(1, trial % 2 == 0, random);
      const Curve curve = any_curve(random);
      std::array<std::int16_t, 19> samples;
      row_kernels(1, taps)[0].run(picture.bytes.data() + 32 * 64 + 32, 64, taps, curve, 16, samples.data());
      for (int i = 0; i < 16; ++i) {
        // In closed form, not step by step.
        const auto place = [i](double from, double step, double bend) {
          return from + i * step + i * (i - 1) / 2 * bend;
        };
        const double x = place(curve.x, curve.dx, curve.ddx), y = place(curve.y, curve.dy, curve.ddy);
        const double left = std::floor(std::ldexp(x, -18)), top = std::floor(std::ldexp(y, -18));
        const auto phase = [](double at, double whole) {
          return static_cast<std::size_t>((std::ldexp(at, -18) - whole) * 256);
        };
        double sum = 0;
        for (int b = 0; b < taps.count; ++b) {
          for (int a = 0; a < taps.count; ++a) {
            const auto at = static_cast<std::size_t>((32 + top - taps.before + b) * 64 + 32 + left - taps.before + a);
            sum += picture.bytes[at] * std::ldexp(taps.phases[phase(x, left)][static_cast<std::size_t>(a)], -14) *
                   std::ldexp(taps.phases[phase(y, top)][static_cast<std::size_t>(b)], -14);
          }
        }
        EXPECT_NEAR(samples[static_cast<std::size_t>(i)] / 64.0, sum, 1.0 / 32) << taps.count << " taps";
      }
    }
  }
}

TEST(RowKernel, EveryKernel_GivesTheBytesOfTheSpecification) {
  std::mt19937 random(4);
  for (const int channels : {1, 3}) {
    for (const Filter filter : kFilters) {
      const Taps& taps = Taps::of(filter);
      for (int trial = 0; trial < 500; ++trial) {
        const Picture picture = picture_of(channels, trial % 2 == 0, random);
        const Curve curve = any_curve(random);
        const std::uint8_t* origin = picture.bytes.data() + (32 * 64 + 32) * channels;
        const auto samples = [&](RowKernel run) {
          std::vector<std::int16_t> made(static_cast<std::size_t>(16 * channels + 3));
          run(origin, 64 * channels, taps, curve, 16, made.data());
          made.resize(static_cast<std::size_t>(16 * channels));
          return made;
        };
        const auto kernels = row_kernels(channels, taps);
        for (const NamedRowKernel& kernel : kernels) {
          EXPECT_EQ(samples(kernel.run), samples(kernels[0].run)) << kernel.name << ", " << taps.count << " taps";
        }
      }
    }
  }
}

}  // namespace
}  // namespace nodal::view
