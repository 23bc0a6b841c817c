// A sunset filmed by heads whose exposures differ by four stops: every seam is compared with the true light of its
// rays, except where no head could measure it. Rendered by the simulator's sensors, blended by the integer code that
// runs on the board. With NODAL_PICTURES=FOLDER the raymaps and close-ups of their seams are saved there.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <string>
#include <vector>

#include "hal/sim/head.h"
#include "hal/sim/scene/response.h"
#include "hal/sim/scene/sensor.h"
#include "stitch/blend/blend.h"
#include "stitch/blend/exposure_tone.h"
#include "stitch/blend/linear_tone.h"
#include "stitch/media/image_file.h"
#include "stitch/table/table_compiler.h"
#include "stitch/table/tone_compiler.h"
#include "tests/reference/png_file.h"
#include "tests/reference/prepared_heads.h"
#include "tests/scenario/small_rig.h"

namespace nodal::scenario {
namespace {

constexpr int kWidth = 1024;
constexpr int kHeight = 512;
constexpr int kSide = 256;            ///< px; side of a head's picture
constexpr std::uint32_t kFrames = 4;  ///< number of raymaps that are averaged, because noise is not a seam
constexpr auto kPixels = static_cast<std::size_t>(kWidth) * kHeight;

/// Four stops between neighbouring heads: two more than 5 ms and two less.
Exposure shutter(std::size_t head) { return Exposure::microseconds(head % 2 == 0 ? 1'250 : 20'000); }

hal::sim::Direction ray_at(int x, int y) {
  const double theta = 2 * M_PI * ((x + 0.5) / kWidth - 0.5);
  const double phi = M_PI * ((y + 0.5) / kHeight - 0.5);
  return {std::sin(theta) * std::cos(phi), std::sin(phi), std::cos(theta) * std::cos(phi)};
}

/// The sun low between the forward and the right head, a sky that darkens away from it, and ground in shadow. Light
/// changes smoothly everywhere, so that every step is the stitcher's error.
class Sunset final : public hal::sim::Scene {
 public:
  hal::sim::Light light(const hal::sim::Direction& from, double /*footprint_rad*/) const override {
    const double beside = std::acos(std::clamp((from.x + from.z) * 0.7021 - from.y * 0.1187, -1.0, 1.0)) * 180 / M_PI;
    const double sun = 40 * std::exp(-beside * beside / 9) + 0.9 * std::exp(-beside / 4) + 0.1 * std::exp(-beside / 30);
    const double up = 1 / (1 + std::exp(from.y * 9));  // the horizon, in some haze
    const double sky = 0.03 + 0.05 * up;
    const double ground = 0.75 + 0.25 * std::sin(9 * from.x) * std::sin(11 * from.z);
    const double level = sky * (up + (1 - up) * ground) + sun * (0.25 + 0.75 * up);
    const double warm = std::exp(-beside / 40);
    return {static_cast<float>(level * (1 + 0.25 * warm)), static_cast<float>(level),
            static_cast<float>(level * (1.15 - 0.55 * warm))};
  }
};

struct Case {
  const char* name;
  PixelFormat format;
  Response response;
  Transition transition = Transition::kFeather;
  double clipped = 0.002;  ///< limit of the clipped share of the sphere
};

/// Extended Reinhard above 0.7, with the darker heads' range up to `top`: recomputed in double precision.
double softened(double value, double top) {
  if (value <= 0.7) return value;
  const double t = (std::min(value, top) - 0.7) / 0.3;
  const double most = (top - 0.7) / 0.3;
  return 0.7 + 0.3 * t * (1 + t / (most * most)) / (1 + t);
}

/// The expected levels of 255 for heads with the mean exposure. Highlights are compressed where light^(1 / 2.2) exceeds
/// 0.7: for each colour separately, or for I420 all colours by luma's factor.
std::array<double, 3> shown(const Case& how, const hal::sim::Light& light) {
  const double top = std::exp2(2 / 2.2);
  std::array<double, 3> levels{std::pow(light.r, 1 / 2.2), std::pow(light.g, 1 / 2.2), std::pow(light.b, 1 / 2.2)};
  const double luma = 0.299 * levels[0] + 0.587 * levels[1] + 0.114 * levels[2];
  for (double& level : levels) {
    const double held = how.format == PixelFormat::kI420 ? level * softened(luma, top) / luma : softened(level, top);
    level = 255 * hal::sim::encode(how.response, std::pow(std::min(held, 1.0), 2.2));
  }
  return levels;
}

class Sunsets : public testing::TestWithParam<Case> {
 protected:
  void SetUp() override {
    calibration_ = small_calibration("sunset");
    for (HeadCalibration& head : calibration_.heads) {
      head.width = head.height = kSide;
      head.center_x = head.center_y = kSide / 2.0;
      head.lens = RectilinearLens{{22.4 * kSide / kHeadSide}};
      head.region = {0, 0, kSide, kSide, std::nullopt};
      head.vignetting = {kSide / 2.0, kSide / 2.0, kSide / 2.0, {}};
      head.response = GetParam().response;
    }
    table::TableOptions options;
    options.transition = GetParam().transition;
    options.sharpen = 0;  // this test does not model sharpening
    table_ = table::compile_blend_table(calibration_, {"equirectangular", kWidth, kHeight, GetParam().format},
                                        std::vector<PixelFormat>(kHeads, GetParam().format), options)
                 .value();
    for (std::size_t h = 0; h < kHeads; ++h) {
      settings_[h] = {shutter(h), Gain::millidecibels(0), {}, {}};
      take(h);
    }
  }

  void take(std::size_t head) {
    hal::sim::HeadOptions options;
    options.pixels = GetParam().format;
    options.reference = Exposure::microseconds(5'000);
    options.noise.levels = 1;  // 48 dB, like NTSC heads; without noise the heads' 8-bit steps would be visible lines
    hal::sim::Sensor sensor(calibration_.heads[head], hal::sim::sensor_options(options), scene_, 1 + head);
    sensor.prepare();
    for (std::uint32_t frame = 0; frame < kFrames; ++frame) {
      std::vector<std::uint8_t>& picture = pictures_[frame][head];
      picture.resize(packed_size(GetParam().format, kSide, kSide));
      sensor.render(settings_[head], Instant(), frame, picture, 0);
    }
  }

  std::vector<ImageView> views_of(std::uint32_t frame) const {
    std::vector<ImageView> views;
    for (std::size_t h = 0; h < kHeads; ++h) {
      views.push_back(packed_image(GetParam().format, kSide, kSide, pictures_[frame][h].data()));
    }
    return views;
  }

  std::vector<blend::ExposedHead> exposed() const {
    std::vector<blend::ExposedHead> heads;
    for (const hal::HeadSettings& head : settings_) heads.push_back({stops_of(head.exposure) + stops_of(head.gain), 0});
    return heads;
  }

  /// The raymap of a frame as RGB; `undo`: whether the exposures are compensated.
  std::vector<std::uint8_t> blend(std::uint32_t frame, bool undo) const {
    const blend::SetTone tone =
        undo ? blend::tone_of_exposures(table_, table::compile_tone_table(calibration_, GetParam().format), exposed())
             : blend::calibrated_tone(table_);
    std::vector<std::uint8_t> raymap(packed_size(GetParam().format, kWidth, kHeight));
    blend::blend_rows(table_, test::PreparedHeads(table_, views_of(frame)).views(), tone,
                      packed_image(GetParam().format, kWidth, kHeight, raymap.data()), 0, kHeight);
    if (GetParam().format == PixelFormat::kRgb24) return raymap;
    return media::convert_image(
               packed_image(GetParam().format, kWidth, kHeight, static_cast<const std::uint8_t*>(raymap.data())),
               PixelFormat::kRgb24)
        .bytes;
  }

  std::vector<double> mean(bool undo) const {
    std::vector<double> sum(3 * kPixels);
    for (std::uint32_t frame = 0; frame < kFrames; ++frame) {
      const std::vector<std::uint8_t> raymap = blend(frame, undo);
      for (std::size_t i = 0; i < sum.size(); ++i) sum[i] += raymap[i] / double{kFrames};
    }
    return sum;
  }

  /// The heads that see each pixel, found by removing all other heads.
  std::vector<std::uint32_t> seen_by() const {
    std::vector<std::uint32_t> masks(kPixels, 0);
    std::vector<std::uint8_t> validity(kPixels);
    const std::vector<std::uint8_t> something(1);
    for (std::size_t h = 0; h < kHeads; ++h) {
      std::vector<ImageView> views(kHeads);
      views[h].planes[0].data = something.data();
      blend::validity_rows(table_, views, {validity.data(), kWidth, kHeight, kWidth, 1}, 0, kHeight);
      for (std::size_t p = 0; p < kPixels; ++p) masks[p] |= validity[p] > 0 ? 1U << h : 0U;
    }
    return masks;
  }

  Calibration calibration_;
  blend::BlendTable table_;
  hal::sim::ScenePtr scene_ = std::make_shared<Sunset>();
  std::array<hal::HeadSettings, kHeads> settings_;
  std::array<std::array<std::vector<std::uint8_t>, kHeads>, kFrames> pictures_;
};

/// The errors in the raymap's own components.
std::array<double, 3> errors(const Case& how, const double* rgb, const hal::sim::Light& light) {
  const std::array<double, 3> expected = shown(how, light);
  const std::array<double, 3> off{rgb[0] - expected[0], rgb[1] - expected[1], rgb[2] - expected[2]};
  if (how.format == PixelFormat::kRgb24) return off;
  const double luma = 0.299 * off[0] + 0.587 * off[1] + 0.114 * off[2];
  return {luma, 0.564 * (off[2] - luma), 0.713 * (off[0] - luma)};
}

/// The error of a raymap, and how much of it is a step where heads meet.
struct Seams {
  double step = 0;  ///< largest change of the mean error between adjacent 16x16 blocks in overlaps
  int step_x = 0, step_y = 0;
  double inside = 0;  ///< the same where only one head looks: not caused by seams
  double mean = 0;    ///< absolute error of all pixels that could be measured
  double worst = 0;
  double unknown = 0;  ///< share of the pixels that are clipped in every head that sees them
};

/// Pixels that a head has seen unclipped, one component after another; error_of(p, light) are the errors of pixel p.
template <class ErrorOf>
Seams measure(const std::vector<std::uint32_t>& seen_by, const hal::sim::Scene& scene, ErrorOf error_of) {
  constexpr int kBlock = 16;
  constexpr int kColumns = kWidth / kBlock, kRows = kHeight / kBlock;
  Seams result;
  for (std::size_t c = 0; c < 3; ++c) {
    std::vector<double> error(kColumns * kRows, 0);
    std::vector<std::uint32_t> all(kColumns * kRows, ~0U), any(kColumns * kRows, 0);
    std::vector<bool> known(kColumns * kRows, true);
    for (int y = 0; y < kHeight; ++y) {
      for (int x = 0; x < kWidth; ++x) {
        const auto p = static_cast<std::size_t>(y * kWidth + x);
        const auto b = static_cast<std::size_t>(y / kBlock * kColumns + x / kBlock);
        const hal::sim::Light light = scene.light(ray_at(x, y), 0);
        const double brightest = std::max({light.r, light.g, light.b});
        // A head two stops below the mean clips at four times the light, one two stops above at a quarter; minus a
        // margin, because neighbouring pixels are interpolated.
        bool seen = false;
        for (std::size_t h = 0; h < kHeads; ++h) {
          const double full = 5000.0 / static_cast<double>(shutter(h).duration().us());
          seen = seen || ((seen_by[p] >> h & 1) != 0 && brightest < 0.85 * full);
        }
        if (!seen && c == 0) result.unknown += 1.0 / kPixels;
        const double off = error_of(p, light)[c];
        if (seen) {
          result.mean += std::abs(off) / (3.0 * kPixels);
          result.worst = std::max(result.worst, std::abs(off));
        }
        known[b] = known[b] && seen;
        error[b] += off / (kBlock * kBlock);
        all[b] &= seen_by[p];
        any[b] |= seen_by[p];
      }
    }
    for (int y = 2; y < kRows - 2; ++y) {  // at the poles a block is extremely narrow
      for (int x = 0; x < kColumns; ++x) {
        const auto b = static_cast<std::size_t>(y * kColumns + x);
        for (const std::size_t other : {static_cast<std::size_t>(y * kColumns + (x + 1) % kColumns), b + kColumns}) {
          if (!known[b] || !known[other]) continue;
          const double step = std::abs(error[b] - error[other]);
          const std::uint32_t heads = any[b] | any[other];
          if ((heads & (heads - 1)) == 0) {
            result.inside = std::max(result.inside, step);
          } else if (step > result.step) {
            result.step = step;
            result.step_x = x * kBlock;
            result.step_y = y * kBlock;
          }
        }
      }
    }
  }
  return result;
}

void leave(const std::vector<std::uint8_t>& raymap, const std::string& name) {
  const char* folder = std::getenv("NODAL_PICTURES");
  if (folder == nullptr) return;
  test::Picture picture(PixelFormat::kRgb24, kWidth, kHeight);
  picture.bytes = raymap;
  ASSERT_TRUE(test::write_png(std::filesystem::path(folder) / (name + ".png"), picture));
}

TEST_P(Sunsets, HeadsFourStopsApart_NoSeamStepsByALevelAndSunAndShadowAreKept) {
  const std::vector<std::uint32_t> masks = seen_by();
  const auto seams = [&](const std::vector<double>& raymap) {
    return measure(masks, *scene_, [&](std::size_t p, const hal::sim::Light& light) {
      return errors(GetParam(), &raymap[3 * p], light);
    });
  };
  const Seams after = seams(mean(true));
  const Seams before = seams(mean(false));
  const std::vector<std::uint8_t> raymap = blend(0, true);
  leave(raymap, std::string(GetParam().name) + "-after");
  leave(blend(0, false), std::string(GetParam().name) + "-before");
  std::printf(
      "%-12s before: step %.2f; after: step %.2f at %d,%d (inside heads %.2f), mean error %.2f, worst %.1f; "
      "clipped by all %.2f %%\n",
      GetParam().name, before.step, after.step, after.step_x, after.step_y, after.inside, after.mean, after.worst,
      100 * after.unknown);
  EXPECT_GT(before.step, 20);
  EXPECT_LE(after.step, 1);
  EXPECT_LT(after.mean, 0.8);
  EXPECT_LT(after.worst, 10) << "noise of a level is lifted to two, and the sun's edge is two pixels wide";
  EXPECT_LT(after.unknown, GetParam().clipped) << "the sun itself, clipped by every head with weight there";
  for (std::size_t c = 0; c < 3; ++c) {
    EXPECT_GE(raymap[3 * (236 * kWidth + 640) + c], 245) << "which is white, not grey";
  }
}

/// The same frames in linear light.
class LinearSunsets : public Sunsets {
 protected:
  /// The scene's light, where 1 fills a sample in 5 ms.
  std::vector<double> mean_light() {
    const table::RaymapSpec spec{"equirectangular", kWidth, kHeight, PixelFormat::kRgb48};
    table::TableOptions options;
    options.transition = GetParam().transition;
    options.sharpen = 0;
    const blend::BlendTable table =
        table::compile_blend_table(calibration_, spec, std::vector<PixelFormat>(kHeads, GetParam().format), options)
            .value();
    const blend::ToneTable tones = table::compile_tone_table(calibration_, spec.format);
    const blend::SetTone tone = blend::linear_tone(table, tones, exposed());
    const double full_us = std::exp2(*blend::linear_scale(tones, tone, exposed()).full / double{kStop});
    std::vector<double> light(3 * kPixels);
    for (std::uint32_t frame = 0; frame < kFrames; ++frame) {
      std::vector<std::uint8_t> bytes(packed_size(spec.format, kWidth, kHeight));
      blend::blend_rows(table, test::PreparedHeads(table, views_of(frame)).views(), tone,
                        packed_image(spec.format, kWidth, kHeight, bytes.data()), 0, kHeight);
      for (std::size_t i = 0; i < light.size(); ++i) {
        light[i] += (bytes[2 * i] | bytes[2 * i + 1] << 8) / 65535.0 * (5000 / full_us) / kFrames;
      }
    }
    return light;
  }
};

TEST_P(LinearSunsets, HeadsFourStopsApart_NumbersAreTheTrueRadianceOnBothSidesOfEverySeam) {
  const std::vector<double> raymap = mean_light();
  const std::vector<std::uint32_t> masks = seen_by();
  const Seams seams = measure(masks, *scene_, [&](std::size_t p, const hal::sim::Light& light) {
    const double* rgb = &raymap[3 * p];
    return std::array<double, 3>{rgb[0] / light.r - 1, rgb[1] / light.g - 1, rgb[2] / light.b - 1};
  });
  std::printf(
      "%-12s of true radiance: mean error %.2f %%, worst pixel %.1f %%; step across seams %.2f %% at %d,%d "
      "(inside heads %.2f %%)\n",
      GetParam().name, 100 * seams.mean, 100 * seams.worst, 100 * seams.step, seams.step_x, seams.step_y,
      100 * seams.inside);
  EXPECT_LT(seams.mean, 0.025) << "noise of a level of the heads, which is 4 % of the light in shadow";
  EXPECT_LT(seams.step, seams.inside) << "where heads meet, it is no worse than in the middle of one";
  // The same as levels of 255 of a head with the mean exposure: the visible size of a step.
  const auto shown = [](double light) { return 255 * std::pow(light, 1 / 2.2); };
  const Seams levels = measure(masks, *scene_, [&](std::size_t p, const hal::sim::Light& light) {
    const double* rgb = &raymap[3 * p];
    return std::array<double, 3>{shown(rgb[0]) - shown(light.r), shown(rgb[1]) - shown(light.g),
                                 shown(rgb[2]) - shown(light.b)};
  });
  std::printf("%-12s as levels of 255: mean error %.2f, step across seams %.2f\n", GetParam().name, levels.mean,
              levels.step);
  EXPECT_LE(levels.step, 1);
}

Response response_of(Response::Curve curve, double gamma = 2.2) {
  Response response;
  response.curve = curve;
  response.gamma = gamma;
  return response;
}

INSTANTIATE_TEST_SUITE_P(
    Heads, Sunsets,
    testing::Values(Case{"rgb-gamma", PixelFormat::kRgb24, response_of(Response::Curve::kGamma)},
                    Case{"rgb-srgb", PixelFormat::kRgb24, response_of(Response::Curve::kSrgb)},
                    Case{"i420-gamma", PixelFormat::kI420, response_of(Response::Curve::kGamma)},
                    Case{"i420-srgb", PixelFormat::kI420, response_of(Response::Curve::kSrgb)},
                    Case{"rgb-seam", PixelFormat::kRgb24, response_of(Response::Curve::kSrgb), Transition::kSeam},
                    Case{"i420-seam", PixelFormat::kI420, response_of(Response::Curve::kGamma), Transition::kSeam},
                    Case{"rgb-bands", PixelFormat::kRgb24, response_of(Response::Curve::kSrgb), Transition::kTwoBand},
                    Case{"i420-bands", PixelFormat::kI420, response_of(Response::Curve::kGamma), Transition::kTwoBand}),
    [](const auto& param_info) {
      std::string name = param_info.param.name;
      std::replace(name.begin(), name.end(), '-', '_');
      return name;
    });

INSTANTIATE_TEST_SUITE_P(
    Heads, LinearSunsets,
    testing::Values(Case{"rgb-gamma", PixelFormat::kRgb24, response_of(Response::Curve::kGamma)},
                    Case{"rgb-srgb", PixelFormat::kRgb24, response_of(Response::Curve::kSrgb)},
                    Case{"rgb-seam", PixelFormat::kRgb24, response_of(Response::Curve::kSrgb), Transition::kSeam},
                    Case{"rgb-bands", PixelFormat::kRgb24, response_of(Response::Curve::kSrgb), Transition::kTwoBand}),
    [](const auto& param_info) { return std::string(param_info.param.name).substr(4); });

}  // namespace
}  // namespace nodal::scenario
