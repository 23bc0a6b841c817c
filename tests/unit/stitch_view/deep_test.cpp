// Raymaps of 16 bits: the same as of 8 bits, only finer.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <numbers>
#include <random>

#include "scene.h"
#include "stitch/view/natural_neighbours.h"
#include "stitch/view/sample.h"
#include "tests/support/layouts.h"

namespace nodal::view {
namespace {

using test::layout_of;

DecodedImage deep_picture(PixelFormat format, int width, int height) {
  DecodedImage image{format, width, height, {}};
  image.bytes.resize(packed_size(format, width, height));
  return image;
}
int deep_at(const DecodedImage& image, std::size_t k) { return load<std::uint16_t>(&image.bytes[2 * k]); }
std::size_t samples_of(const DecodedImage& image) { return image.bytes.size() / 2; }

/// Noise, or only black and white: the largest overshoots.
DecodedImage deep_noise(PixelFormat format, int width, int height, bool extreme) {
  std::mt19937 random(5);
  DecodedImage image = deep_picture(format, width, height);
  for (std::size_t k = 0; k < samples_of(image); ++k) {
    store(static_cast<std::uint16_t>(extreme ? random() % 2 * 65535 : random() % 65536), &image.bytes[2 * k]);
  }
  return image;
}

/// The scene in steps of 1/256 of a level.
DecodedImage deep_scene(const Target& target) {
  DecodedImage image = deep_picture(PixelFormat::kGrey16, target.width, target.height);
  for (int k = 0; k < target.width * target.height; ++k) {
    const auto ray = target.ray(k % target.width + 0.5, k / target.width + 0.5);
    store(static_cast<std::uint16_t>(ray ? std::lround(level(*ray) * 257) : 0),
          &image.bytes[2 * static_cast<std::size_t>(k)]);
  }
  return image;
}

/// The weight of a pixel t pixels away, by the filters' definitions.
double exact_weight(Filter filter, double t) {
  const double a = std::abs(t), x = std::numbers::pi * t;
  switch (filter) {
    case Filter::kNearest: return t > -0.5 && t <= 0.5 ? 1 : 0;
    case Filter::kBilinear: return std::max(0.0, 1 - a);
    case Filter::kBicubic:
      return a < 1 ? 1.5 * a * a * a - 2.5 * a * a + 1 : a < 2 ? -0.5 * (a - 1) * (a - 2) * (a - 2) : 0;
    case Filter::kLanczos: return a < 1e-9 ? 1 : a < 3 ? std::sin(x) / x * std::sin(x / 3) / (x / 3) : 0;
  }
  return 0;
}

class Deep : public testing::TestWithParam<Filter> {
 protected:
  const parallel::Workers workers_{2};
};

TEST_P(Deep, BetweenPixels_IsTheFilterInDoublePrecision_WithinHalfALevel) {
  const auto sphere = layout_of("equirectangular", 96);
  const int width = sphere->width(), height = sphere->height();
  const Resampler resampler(*sphere, GetParam(), workers_);
  for (const bool extreme : {false, true}) {
    const DecodedImage noise = deep_noise(PixelFormat::kRgb48, width, height, extreme);
    for (const auto& [across, down] : {std::pair(64, 200), std::pair(127, 129), std::pair(255, 1), std::pair(33, 0)}) {
      for (const bool smooth : {true, false}) {  // by cells, and pixel by pixel
        Target target = Target::of(*sphere);
        target.smooth = smooth;
        const double dx = across / 256.0, dy = down / 256.0;
        target.ray = [&](double x, double y) {
          return sphere->ray(std::fmod(x + dx, width), std::min<double>(y + dy, height));
        };
        const DecodedImage made = resampler.resample(noise.view(), target, workers_);
        ASSERT_EQ(made.format, PixelFormat::kRgb48);
        double worst = 0;
        bool black = false, white = false;
        for (int y = 4; y < height - 4; ++y) {
          for (int x = 0; x < width; ++x) {
            std::array<double, 3> sum{};
            double total = 0;
            for (int b = -2; b <= 3; ++b) {
              for (int a = -2; a <= 3; ++a) {
                const double weight = exact_weight(GetParam(), a - dx) * exact_weight(GetParam(), b - dy);
                const auto pixel = static_cast<std::size_t>((y + b) * width + (x + a + width) % width);
                for (std::size_t c = 0; c < 3; ++c) sum[c] += weight * deep_at(noise, 3 * pixel + c);
                total += weight;
              }
            }
            for (std::size_t c = 0; c < 3; ++c) {
              const double expected = std::clamp(sum[c] / total, 0.0, 65535.0);
              const int got = deep_at(made, 3 * static_cast<std::size_t>(y * width + x) + c);
              worst = std::max(worst, std::abs(got - expected));
              black = black || (got == 0 && sum[c] < -100), white = white || (got == 65535 && sum[c] > 65635);
            }
          }
        }
        // Half a level of rounding; 1/32 for samples in 1/64 levels, the rest for weights in 2^-22.
        EXPECT_LE(worst, 0.55) << across << ", " << down << (smooth ? ", cells" : ", pixels");
        const bool overshoots = GetParam() == Filter::kBicubic || GetParam() == Filter::kLanczos;
        if (extreme && overshoots && across == 127) {
          EXPECT_TRUE(black && white) << "clamped, not wrapped";
        }
      }
    }
  }
}

TEST_P(Deep, ToTheSameSize_EveryLevelIsUnchanged) {
  const auto sphere = layout_of("equirectangular", 512);
  DecodedImage gradient = deep_picture(PixelFormat::kGrey16, 512, 256);
  for (std::size_t k = 0; k < samples_of(gradient); ++k) {
    store(static_cast<std::uint16_t>(k / 2), &gradient.bytes[2 * k]);
  }
  const Resampler resampler(*sphere, GetParam(), workers_);
  for (const bool smooth : {true, false}) {
    Target target = Target::of(*sphere);
    target.smooth = smooth;
    for (const DecodedImage& picture : {gradient, deep_noise(PixelFormat::kRgb48, 512, 256, false)}) {
      const DecodedImage made = resampler.resample(picture.view(), target, workers_);
      int changed = 0, row = -1;
      for (std::size_t k = 0; k < samples_of(picture); ++k) {
        if (deep_at(made, k) == deep_at(picture, k)) continue;
        ++changed;
        row = static_cast<int>(k * 256 / samples_of(picture));
      }
      EXPECT_EQ(changed, 0) << "the last in row " << row;
    }
  }
}

TEST_P(Deep, ToACubeAndBack_ShowsTheSceneFinerThanALevelOf8Bits) {
  const auto sphere = layout_of("equirectangular", 640), cube = layout_of("cube", 480);
  const DecodedImage picture = deep_scene(Target::of(*sphere));
  const DecodedImage shown =
      Resampler(*sphere, GetParam(), workers_).resample(picture.view(), Target::of(*cube), workers_);
  const DecodedImage back =
      Resampler(*cube, GetParam(), workers_).resample(shown.view(), Target::of(*sphere), workers_);
  double sum = 0;
  int rounded = 0;
  for (std::size_t k = 0; k < samples_of(back); ++k) {
    sum += std::pow(deep_at(back, k) - deep_at(picture, k), 2);
    rounded += deep_at(back, k) % 257 == 0 ? 1 : 0;
  }
  const auto count = static_cast<double>(samples_of(back));
  EXPECT_LT(std::sqrt(sum / count), 257 * (GetParam() == Filter::kNearest ? 5 : 0.75));
  EXPECT_LT(rounded / count, 0.01) << "one of 257 by chance";
}

TEST_P(Deep, ALevelTimes257_BecomesTheResultTimes257) {
  for (const char* text : {"equirectangular", "cube", "hammersley"}) {
    const auto from = layout_of(text, 200), to = layout_of("cube", 120);
    const DecodedImage picture = picture_of(Target::of(*from));
    DecodedImage deep = deep_picture(PixelFormat::kGrey16, picture.width, picture.height);
    for (std::size_t k = 0; k < picture.bytes.size(); ++k) {
      store(static_cast<std::uint16_t>(257 * picture.bytes[k]), &deep.bytes[2 * k]);
    }
    const Resampler resampler(*from, GetParam(), workers_);
    const DecodedImage in_8 = resampler.resample(picture.view(), Target::of(*to), workers_);
    const DecodedImage in_16 = resampler.resample(deep.view(), Target::of(*to), workers_);
    double worst = 0;
    for (std::size_t k = 0; k < in_8.bytes.size(); ++k) {
      worst = std::max(worst, std::abs(deep_at(in_16, k) / 257.0 - in_8.bytes[k]));
    }
    EXPECT_LE(worst, 0.6) << text << ": half a level of 8 bits, and 1/512 px beside edges";
  }
}

TEST_P(Deep, OfScatteredRays_IsTheMeanOfNaturalNeighboursInDoublePrecision) {
  const auto rays = layout_of("hammersley", 96), to = layout_of("equirectangular", 64);
  const DecodedImage noise = deep_noise(PixelFormat::kGrey16, rays->width(), rays->height(), false);
  const DecodedImage made = Resampler(*rays, GetParam(), workers_).resample(noise.view(), Target::of(*to), workers_);
  if (GetParam() == Filter::kNearest) return;  // takes one pixel
  const auto& scattered = dynamic_cast<const geometry::ScatteredRays&>(*rays);
  for (int y = 0; y < to->height(); ++y) {
    for (int x = 0; x < to->width(); ++x) {
      double sum = 0;
      for (const Neighbour& neighbour : natural_neighbours(scattered, *to->ray(x + 0.5, y + 0.5))) {
        sum += neighbour.weight * deep_at(noise, static_cast<std::size_t>(neighbour.j * rays->width() + neighbour.i));
      }
      EXPECT_NEAR(deep_at(made, static_cast<std::size_t>(y * to->width() + x)), sum, 0.5001) << x << " " << y;
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Filters, Deep,
                         testing::Values(Filter::kNearest, Filter::kBilinear, Filter::kBicubic, Filter::kLanczos));

TEST(DeepResampler, LargerPixels_AreTheMeanOfWhatTheyCover_AndAnyNumberOfThreadsGivesTheSameBytes) {
  const auto from = layout_of("equirectangular", 512), to = layout_of("healpix", 64);
  const DecodedImage noise = deep_noise(PixelFormat::kRgb48, 512, 256, true);
  const parallel::Workers one(1), three(3);
  const Resampler resampler(*from, Filter::kBicubic, one);
  const DecodedImage made = resampler.resample(noise.view(), Target::of(*to), one);
  EXPECT_EQ(made.bytes, resampler.resample(noise.view(), Target::of(*to), three).bytes);
  double sum = 0, square = 0;
  for (std::size_t k = 0; k < samples_of(made); ++k) {
    const double away = deep_at(made, k) - 32767.5;
    sum += away, square += away * away;
  }
  const auto count = static_cast<double>(samples_of(made));
  EXPECT_NEAR(sum / count, 0, 1500);
  EXPECT_LT(std::sqrt(square / count), 12000) << "32767.5 of every pixel by itself";
}

}  // namespace
}  // namespace nodal::view
