// More heads than a blend table can name: the parts of a raymap against a table of the whole, and against the scene.
#include "stitch/offline/parts.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>

#include "stitch/geometry/head.h"
#include "stitch/offline/offline_blend.h"
#include "tests/support/layouts.h"
#include "tests/support/rendered_rig.h"

namespace nodal::offline {
namespace {

using test::layout_of;

constexpr int kPartsWidth = 512;

test::RenderedRig town(const Calibration& rig, PixelFormat format) {
  return test::render_rig(rig, hal::sim::town_square_scene(3), {format, 0, 5, 2});
}

/// The same pictures, blended by one table and by tables for parts of at most `most` heads.
void expect_same(const test::RenderedRig& rig, PixelFormat raymap, const std::string& layout_name, std::size_t most) {
  const auto layout = layout_of(layout_name, kPartsWidth);
  const table::RaymapSpec spec{layout_name, layout->width(), layout->height(), raymap};
  const auto parts = cut_into_parts(rig.truth, *layout, most);
  ASSERT_TRUE(parts) << parts.error().text();
  EXPECT_GT(parts->size(), 1U);
  for (const Part& part : *parts) EXPECT_LE(part.heads.size(), most);
  const std::vector<ImageView> frames = rig.frames();
  const auto whole = OfflineBlend::make(rig.truth, spec, {}, rig.format, 2, {})->blend(frames);
  const auto cut = OfflineBlend::make(rig.truth, spec, {}, rig.format, 2, {}, most)->blend(frames);
  ASSERT_TRUE(whole && cut);
  EXPECT_TRUE(whole->bytes == cut->bytes);
}

TEST(Parts, TheBytesAreThoseOfOneTable) {
  Calibration rig = test::three_rings(120, 75);
  rig.heads.resize(16);
  rig = test::turned(rig, 3, 10, 4);
  expect_same(town(rig, PixelFormat::kRgb24), PixelFormat::kRgb24, "equirectangular", 10);
  expect_same(town(rig, PixelFormat::kI420), PixelFormat::kI420, "equirectangular", 12);
  expect_same(town(rig, PixelFormat::kRgb24), PixelFormat::kRgb48, "cube", 15);
}

TEST(Parts, TwentyFourHeads_ShowTheScene) {
  const test::RenderedRig rig = town(test::three_rings(120, 75), PixelFormat::kRgb24);
  const auto layout = layout_of("equirectangular", kPartsWidth);
  const auto parts = cut_into_parts(rig.truth, *layout);
  ASSERT_TRUE(parts) << parts.error().text();
  EXPECT_GT(parts->size(), 1U);
  std::vector<int> held(parts->front().blocks.size());
  for (const Part& part : *parts) {
    EXPECT_LE(part.heads.size(), 16U);
    for (std::size_t b = 0; b < held.size(); ++b) held[b] += part.blocks[b] ? 1 : 0;
  }
  EXPECT_EQ(*std::ranges::max_element(held), 1) << "no block is in two parts";
  const table::RaymapSpec spec{"equirectangular", layout->width(), layout->height(), PixelFormat::kRgb24};
  const auto blend = OfflineBlend::make(rig.truth, spec, {}, rig.format, 2, {});
  ASSERT_TRUE(blend) << blend.error().text();
  const auto sphere = blend->blend(rig.frames());
  ASSERT_TRUE(sphere) << sphere.error().text();
  // The scene through a head of the same response that looks along each ray: a second rig, rendered by the simulator,
  // whose single head is an equidistant fisheye of 170 degrees. It shares no code with the blend.
  Calibration eye = test::six_fisheyes(1024, 170);
  eye.heads.resize(1);
  const test::RenderedRig seen = town(eye, PixelFormat::kRgb24);
  const geometry::Head head = geometry::Head::make(eye.heads.front()).value();
  double square = 0, count = 0;
  for (int y = 0; y < layout->height(); ++y) {
    for (int x = 0; x < layout->width(); ++x) {
      const auto pixel = head.project(*layout->ray(x + 0.5, y + 0.5));
      if (!pixel || !head.contains(*pixel) || head.distance_to_edge(*pixel) < 2) continue;
      for (std::size_t c = 0; c < 3; ++c) {
        const auto at = [&](const std::vector<std::uint8_t>& bytes, int width, int i, int j) {
          return static_cast<double>(bytes[(static_cast<std::size_t>(j * width + i)) * 3 + c]);
        };
        const double off = at(sphere->bytes, layout->width(), x, y) -
                           at(seen.bytes[0], 1024, static_cast<int>(pixel->x), static_cast<int>(pixel->y));
        square += off * off;
        ++count;
      }
    }
  }
  ASSERT_GT(count, 0.4 * 3 * kPartsWidth * kPartsWidth / 2);
  EXPECT_GT(10 * std::log10(255 * 255 / (square / count)), 25) << "dB";
}

TEST(Parts, TooManyHeadsAtOnePlace_AreRefusedWithWhatToDo) {
  const Calibration rig = test::three_rings(120, 170);
  const auto parts = cut_into_parts(rig, *layout_of("equirectangular", kPartsWidth));
  ASSERT_FALSE(parts);
  EXPECT_EQ(parts.error().code, Errc::kTooLarge);
  EXPECT_NE(parts.error().message.find("leave some of them out"), std::string::npos) << parts.error().message;
}

}  // namespace
}  // namespace nodal::offline
