#include "hal/sim/scene/sensor.h"
#include "hal/sim/head.h"

#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <vector>

#include "hal/sim/scene/response.h"
#include "stitch/media/image_file.h"
#include "tests/support/pictures.h"
#include "tests/support/rigs.h"

namespace nodal::hal::sim {
namespace {

constexpr Instant kNow = Instant::from_ns(5'000'000'000);

std::vector<std::uint8_t> render(Sensor& sensor, const HeadCalibration& head, const HeadOptions& options,
                                 const HeadSettings& settings = {}, std::uint32_t number = 0, Instant at = kNow) {
  std::vector<std::uint8_t> bytes(packed_size(options.pixels, head.width, head.height));
  sensor.render(settings, at, number, bytes, 0, options.fields);
  return bytes;
}

std::vector<std::uint8_t> render_once(const HeadCalibration& head, const HeadOptions& options, const ScenePtr& scene,
                                      const HeadSettings& settings = {}) {
  Sensor sensor(head, sensor_options(options), scene, 1);
  return render(sensor, head, options, settings);
}

HeadOptions with(PixelFormat pixels) {
  HeadOptions options;
  options.pixels = pixels;
  return options;
}

struct Statistics {
  double mean = 0, deviation = 0;
};
Statistics of(const std::vector<std::uint8_t>& bytes) {
  double sum = 0, squares = 0;
  for (const std::uint8_t b : bytes) {
    sum += b;
    squares += double(b) * b;
  }
  const auto n = static_cast<double>(bytes.size());
  return {sum / n, std::sqrt(std::max(0.0, squares / n - sum * sum / n / n))};
}

Light grey(double level) {
  const auto l = static_cast<float>(level / 255);
  return {l, l, l};
}

class EveryFormat : public testing::TestWithParam<PixelFormat> {};

TEST_P(EveryFormat, ConstantGrey_EverySampleIsExactlyThatLevelAndColourIsNeutral) {
  for (const int level : {0, 1, 37, 128, 254, 255}) {
    const HeadCalibration head = test::plain_head("cam0", 22, 14);
    const auto bytes = render_once(head, with(GetParam()), constant_scene(grey(level)));
    const ImageView image = packed_image(GetParam(), 22, 14, bytes.data());
    for (int c = 0; c < component_count(GetParam()); ++c) {
      const PlaneView& plane = image.planes[static_cast<std::size_t>(c)];
      const int expected = c > 0 && GetParam() != PixelFormat::kRgb24 ? 128 : level;
      for (int y = 0; y < plane.height; ++y) {
        for (int x = 0; x < plane.width; ++x) {
          ASSERT_EQ(plane.data[y * plane.row_stride + x * plane.pixel_stride], expected) << c << " " << x << " " << y;
        }
      }
    }
  }
}

// JFIF's values for pure red: Y 76, Cb 85, Cr 255.5 clipped.
TEST_P(EveryFormat, PureRed_IsWhatJfifSays) {
  if (component_count(GetParam()) == 1) GTEST_SKIP() << "grey";
  const auto bytes = render_once(test::plain_head("cam0", 16, 8), with(GetParam()), constant_scene({1, 0, 0}));
  const ImageView image = packed_image(GetParam(), 16, 8, bytes.data());
  const bool rgb = GetParam() == PixelFormat::kRgb24;
  EXPECT_EQ(image.planes[0].data[0], rgb ? 255 : 76);
  EXPECT_EQ(image.planes[1].data[0], rgb ? 0 : 85);
  EXPECT_EQ(image.planes[2].data[0], rgb ? 0 : 255);
}

// The same frame in RGB, converted by other code, differs by rounding only.
TEST_P(EveryFormat, TownSquare_IsTheRgbFrameInAnotherFormat) {
  HeadCalibration head = test::plain_head("cam0", 160, 120, 20);
  head.response = {Response::Curve::kSrgb, 1, {}};
  const ScenePtr scene = town_square_scene();
  const auto rgb = render_once(head, with(PixelFormat::kRgb24), scene);
  const auto wanted = media::convert_image(packed_image(PixelFormat::kRgb24, 160, 120, rgb.data()), GetParam());
  const auto got = render_once(head, with(GetParam()), scene);
  EXPECT_GT(test::psnr(got, wanted.bytes), 53);
}

INSTANTIATE_TEST_SUITE_P(All, EveryFormat,
                         testing::Values(PixelFormat::kGrey8, PixelFormat::kI420, PixelFormat::kNv12,
                                         PixelFormat::kYuyv, PixelFormat::kUyvy, PixelFormat::kRgb24),
                         [](const auto& format) { return std::string(pixel_format_name(format.param)); });

TEST(Sensor, OddSizes_EveryFormatWithOddSizesRenders) {
  for (const PixelFormat pixels :
       {PixelFormat::kGrey8, PixelFormat::kI420, PixelFormat::kNv12, PixelFormat::kRgb24, PixelFormat::kYuyv}) {
    const auto bytes = render_once(test::plain_head("cam0", 33, 17), with(pixels), town_square_scene());
    EXPECT_GT(of(bytes).mean, 10);
  }
}

TEST(Sensor, ExposureGainAndBalance_MultiplyLight) {
  const HeadCalibration head = test::plain_head("cam0", 8, 8);
  const HeadOptions options = with(PixelFormat::kRgb24);
  const auto level = [&](const HeadSettings& settings, std::size_t c) {
    return render_once(head, options, constant_scene(grey(50)), settings)[c];
  };
  EXPECT_EQ(level({}, 0), 50);
  EXPECT_EQ(level({Exposure::microseconds(20'000), {}, {}, {}}, 1), 100);
  EXPECT_EQ(level({Exposure::microseconds(2'000), {}, {}, {}}, 1), 10);
  EXPECT_EQ(level({{}, Gain::millidecibels(12'041), {}, {}}, 2), 200) << "12.04 dB is four times";
  EXPECT_EQ(level({{}, {}, {8192, 2048}, {}}, 0), 100);
  EXPECT_EQ(level({{}, {}, {8192, 2048}, {}}, 1), 50);
  EXPECT_EQ(level({{}, {}, {8192, 2048}, {}}, 2), 25);
  EXPECT_EQ(level({Exposure::microseconds(33'000), Gain::millidecibels(24'000), {}, {}}, 0), 255) << "clips";
}

TEST(Sensor, Response_EncodesLight) {
  HeadCalibration head = test::plain_head("cam0", 8, 8);
  head.response = {Response::Curve::kGamma, 2.2, {}};
  EXPECT_EQ(render_once(head, with(PixelFormat::kRgb24), constant_scene({0.5F, 0.5F, 0.5F}))[0], 186);
  head.response = {Response::Curve::kSrgb, 1, {}};
  EXPECT_EQ(render_once(head, with(PixelFormat::kRgb24), constant_scene({0.5F, 0.5F, 0.5F}))[0], 188);
}

TEST(Sensor, VignettingAndHeadGain_AreWhatTheCalibrationSays) {
  HeadCalibration head = test::plain_head("cam0", 200, 100);
  head.aspect = 1.25;
  head.vignetting = {100, 50, 100, {-0.3, -0.1, 0.05}};
  head.gain = {1.1, 1, 0.9};
  const auto bytes = render_once(head, with(PixelFormat::kRgb24), constant_scene(grey(200)));
  for (const auto& [x, y] : {std::pair{100, 50}, {0, 0}, {199, 99}, {30, 80}, {150, 10}}) {
    const double dx = x + 0.5 - 100;
    const double dy = (y + 0.5 - 50) / 1.25;
    const double s = (dx * dx + dy * dy) / 10'000;
    const double v = 1 - 0.3 * s - 0.1 * s * s + 0.05 * s * s * s;
    const auto at = static_cast<std::size_t>(3 * (200 * y + x));
    EXPECT_NEAR(bytes[at], 200 * v * 1.1, 0.52);
    EXPECT_NEAR(bytes[at + 1], 200 * v, 0.52);
    EXPECT_NEAR(bytes[at + 2], 200 * v * 0.9, 0.52);
  }
}

TEST(Sensor, LevelNoise_HasTheStatedDeviationAndNoBias) {
  HeadOptions options = with(PixelFormat::kGrey8);
  options.noise.levels = 3;
  // Grey is the sum of three channels with independent noise: 3 sqrt(0.299^2 + 0.587^2 + 0.114^2).
  const double expected = 3 * std::sqrt(0.299 * 0.299 + 0.587 * 0.587 + 0.114 * 0.114);
  const Statistics seen = of(render_once(test::plain_head("cam0", 300, 200), options, constant_scene(grey(120))));
  EXPECT_NEAR(seen.mean, 120, 0.05);
  EXPECT_NEAR(seen.deviation, std::sqrt(expected * expected + 1.0 / 12), 0.04);
}

// Poisson: light l of n electrons has a deviation of sqrt(l n) electrons; gain needs fewer for the same level.
TEST(Sensor, ShotAndReadNoise_FollowTheElectrons) {
  HeadOptions options = with(PixelFormat::kRgb24);
  options.noise.full_well_electrons = 5'000;
  options.noise.read_electrons = 20;
  const HeadCalibration head = test::plain_head("cam0", 200, 200);
  for (const double level : {30.0, 120.0}) {
    for (const int gain : {1, 4}) {
      HeadSettings settings;
      settings.gain = Gain::millidecibels(gain == 1 ? 0 : 12'041);
      settings.exposure = Exposure::microseconds(10'000 / gain);
      const double electrons = level / 255 * 5'000 / gain;
      const double expected = std::sqrt(electrons + 20 * 20) / (5'000.0 / gain) * 255;
      const Statistics seen = of(render_once(head, options, constant_scene(grey(level)), settings));
      EXPECT_NEAR(seen.deviation, std::sqrt(expected * expected + 1.0 / 12), 0.03 * expected) << level << " " << gain;
      EXPECT_NEAR(seen.mean, level, 0.2);
    }
  }
}

TEST(Sensor, SameSeed_SameBytesAndAnotherSeedOthers) {
  HeadOptions options = with(PixelFormat::kI420);
  options.noise.levels = 2;
  const HeadCalibration head = test::plain_head("cam0", 64, 48);
  const auto frames = [&](std::uint64_t seed) {
    Sensor sensor(head, sensor_options(options), town_square_scene(), seed);
    std::vector<std::uint8_t> all;
    for (std::uint32_t n = 0; n < 40; ++n) {
      const auto bytes = render(sensor, head, options, {}, n, kNow + Duration::milliseconds(33 * n));
      all.insert(all.end(), bytes.begin(), bytes.end());
    }
    return all;
  };
  EXPECT_EQ(frames(4), frames(4));
  EXPECT_NE(frames(4), frames(5));
}

TEST(Sensor, NoiseFromFrameToFrame_IsNotTheSame) {
  HeadOptions options = with(PixelFormat::kGrey8);
  options.noise.levels = 4;
  const HeadCalibration head = test::plain_head("cam0", 64, 48);
  Sensor sensor(head, sensor_options(options), constant_scene(grey(100)), 3);
  std::vector<std::vector<std::uint8_t>> different;
  for (std::uint32_t n = 0; n < 60; ++n) {
    const auto bytes = render(sensor, head, options, {}, n);
    if (std::find(different.begin(), different.end(), bytes) == different.end()) different.push_back(bytes);
  }
  EXPECT_GE(different.size(), 4U);
}

// Drawing movers in blocks over the static part must give the same frame as drawing it at once.
TEST(Sensor, BalloonInView_MovesAndLeavesTheRestAlone) {
  const ScenePtr scene = town_square_scene();
  const HeadCalibration head = test::plain_head("cam0", 320, 240, 10, 100);
  const HeadOptions options = with(PixelFormat::kRgb24);
  Sensor sensor(head, sensor_options(options), scene, 1);
  const auto first = render(sensor, head, options, {}, 0, Instant{});
  const auto same = render(sensor, head, options, {}, 1, Instant{});
  const auto later = render(sensor, head, options, {}, 2, Instant{} + Duration::seconds(3));
  EXPECT_EQ(first, same);
  std::size_t changed = 0;
  for (std::size_t i = 0; i < first.size(); i += 3) changed += first[i] != later[i];
  EXPECT_GT(changed, 50U);
  EXPECT_LT(changed, first.size() / 3 / 10);
  // In the direction of the first balloon its colours are seen, not the sky.
  const Mover& balloon = scene->movers()[0];
  const LensTruth lens(head);
  std::size_t on_it = 0;
  for (int y = 0; y < 240; ++y) {
    for (int x = 0; x < 320; ++x) {
      const auto ray = lens.ray(x + 0.5, y + 0.5);
      const auto cover = PlacedMover(balloon, Instant{}).cover(*ray, lens.footprint(x + 0.5, y + 0.5));
      if (cover.share < 1) continue;
      ++on_it;
      const auto at = static_cast<std::size_t>(3 * (320 * y + x));
      EXPECT_NEAR(first[at], 255 * std::min(1.0F, cover.light.r), 1.01);
      EXPECT_NEAR(first[at + 1], 255 * std::min(1.0F, cover.light.g), 1.01);
    }
  }
  EXPECT_GT(on_it, 30U);
}

class InterlacedSensor : public testing::TestWithParam<std::tuple<Fields, PixelFormat>> {};

TEST_P(InterlacedSensor, EachFieldIsAWholePictureOfItsOwnMoment) {
  const auto [fields, format] = GetParam();
  const HeadCalibration head = test::plain_head("cam0", 320, 240, 10, 100);
  HeadOptions interlaced = with(format);
  interlaced.fields = fields;
  interlaced.rate = {1, 2};  // slow, so that the fields differ
  Sensor sensor(head, sensor_options(interlaced), town_square_scene(), 1);
  Sensor whole(head, sensor_options(with(format)), town_square_scene(), 1);
  const auto woven = render(sensor, head, interlaced, {}, 0, kNow);
  const Instant later = kNow + Duration::seconds(1);
  const bool top_first = fields == Fields::kTopFirst;
  const auto top = render(whole, head, with(format), {}, 0, top_first ? kNow : later);
  const auto bottom = render(whole, head, with(format), {}, 0, top_first ? later : kNow);
  ASSERT_NE(top, bottom);
  const ImageView frame = packed_image(format, 320, 240, woven.data());
  for (const FieldParity parity : {FieldParity::kTop, FieldParity::kBottom}) {
    const bool is_top = parity == FieldParity::kTop;
    const PlaneView got = field_of(frame, parity).planes[0];
    const PlaneView expected = packed_image(format, 320, 240, (is_top ? top : bottom).data()).planes[0];
    for (int y = 0; y < 120; ++y) {
      for (int x = 0; x < 320; ++x) {
        ASSERT_EQ(got.data[y * got.row_stride + x * got.pixel_stride],
                  expected.data[(2 * y + (is_top ? 0 : 1)) * expected.row_stride + x * expected.pixel_stride])
            << "row " << y << " column " << x;
      }
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Orders, InterlacedSensor,
                         testing::Combine(testing::Values(Fields::kTopFirst, Fields::kBottomFirst),
                                          testing::Values(PixelFormat::kRgb24, PixelFormat::kYuyv)));

// The light is one in a field's upper rows and none in the others, so a chroma row that mixed two fields would show: a
// field's chroma must be made of that field's rows alone.
TEST(Sensor, InterlacedI420_ChromaRowsBelongToTheFieldsInTurns) {
  HeadCalibration head = test::plain_head("cam0", 320, 240, 10, 100);
  HeadOptions options = with(PixelFormat::kI420);
  options.fields = Fields::kTopFirst;
  options.rate = {1, 2};
  Sensor sensor(head, sensor_options(options), town_square_scene(), 1);
  Sensor whole(head, sensor_options(with(PixelFormat::kRgb24)), town_square_scene(), 1);
  const auto woven = render(sensor, head, options, {}, 0, kNow);
  const auto first = render(whole, head, with(PixelFormat::kRgb24), {}, 0, kNow);
  const PlaneView v = field_of(packed_image(PixelFormat::kI420, 320, 240, woven.data()), FieldParity::kTop).planes[2];
  for (int y = 0; y < 60; ++y) {
    for (int x = 0; x < 160; ++x) {
      // BT.601's V of the four pixels: field rows 2 y and 2 y + 1 are frame rows 4 y, 4 y + 2.
      double red_difference = 0;
      for (int k = 0; k < 4; ++k) {
        const std::uint8_t* p = &first[static_cast<std::size_t>(3 * (320 * (4 * y + 2 * (k / 2)) + 2 * x + k % 2))];
        red_difference += (0.5 * p[0] - 0.418688 * p[1] - 0.081312 * p[2]) / 4;
      }
      ASSERT_NEAR(v.data[y * v.row_stride + x * v.pixel_stride], 128 + red_difference, 1.1) << x << " " << y;
    }
  }
}

TEST(Sensor, UnchangedStill_IsNotWrittenAgainAndAChangedOneIs) {
  const HeadCalibration head = test::plain_head("cam0", 16, 16);
  const HeadOptions options = with(PixelFormat::kGrey8);
  Sensor sensor(head, sensor_options(options), constant_scene(grey(80)), 1);
  std::vector<std::uint8_t> bytes(256);
  const std::uint64_t holds = sensor.render({}, kNow, 0, bytes, 0);
  ASSERT_NE(holds, 0U);
  bytes[7] = 99;  // rewriting the frame would overwrite this
  EXPECT_EQ(sensor.render({}, kNow, 1, bytes, holds), holds);
  EXPECT_EQ(bytes[7], 99);
  HeadSettings brighter;
  brighter.exposure = Exposure::microseconds(20'000);
  EXPECT_NE(sensor.render(brighter, kNow, 2, bytes, holds), holds);
  EXPECT_EQ(bytes[7], 160);
}

}  // namespace
}  // namespace nodal::hal::sim
