// The blend in many bands: what it must reproduce, and how wide its transitions are.
#include "stitch/bands/multi_band.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>
#include <random>

namespace nodal::bands {
namespace {

constexpr Grid kSphere{256, 128};
using Where = std::function<bool(int, int)>;

/// One colour; seen where `seen`, to be shown where `shown`.
Layer picture(const std::function<float(int, int)>& value, const Where& seen, const Where& shown) {
  Layer made(kSphere, Window::all(kSphere), 3);
  for (int y = 0; y < kSphere.height; ++y) {
    for (int x = 0; x < kSphere.width; ++x) {
      if (!seen(x, y)) continue;
      made.at(x, y)[0] = value(x, y);
      made.at(x, y)[1] = 1;
      made.at(x, y)[2] = shown(x, y) ? 1 : 0;
    }
  }
  return made;
}
bool everywhere(int, int) { return true; }

TEST(MultiBand, OnePicture_IsReproduced) {
  std::mt19937 random(1);
  std::uniform_real_distribution<float> level(0, 255);
  std::vector<float> truth;
  MultiBand blend(kSphere, Window::all(kSphere), 1, 2);
  blend.add(picture([&](int, int) { return truth.emplace_back(level(random)); }, everywhere, everywhere));
  const Layer made = blend.finish();
  for (std::size_t k = 0; k < truth.size(); ++k) {
    ASSERT_NEAR(*made.at(static_cast<int>(k % 256), static_cast<int>(k / 256)), truth[k], 2e-3) << k;
  }
}

TEST(MultiBand, EqualPictures_NoSeamShows) {
  std::mt19937 random(2);
  std::uniform_real_distribution<float> level(0, 255);
  std::vector<float> truth(static_cast<std::size_t>(kSphere.width * kSphere.height));
  std::ranges::generate(truth, [&] { return level(random); });
  const auto value = [&](int x, int y) { return truth[static_cast<std::size_t>(y * kSphere.width + x)]; };
  MultiBand blend(kSphere, Window::all(kSphere), 1, 2);
  const auto left = [](int x, int y) { return x < 100 + y / 2; };
  blend.add(picture(value, everywhere, left));
  blend.add(picture(value, everywhere, [&](int x, int y) { return !left(x, y); }));
  const Layer made = blend.finish();
  for (int y = 0; y < kSphere.height; ++y) {
    for (int x = 0; x < kSphere.width; ++x) ASSERT_NEAR(*made.at(x, y), value(x, y), 5e-3) << x << ", " << y;
  }
}

TEST(MultiBand, DetailOfOneHeadOnly_EndsAtTheSeam) {
  // A checkerboard beside grey of the same mean: at most a pixel of transition.
  MultiBand blend(kSphere, Window::all(kSphere), 1, 2);
  blend.add(picture([](int x, int y) { return (x + y) % 2 == 0 ? 60.0F : 140.0F; }, everywhere,
                    [](int x, int) { return x < 128; }));
  blend.add(picture([](int, int) { return 100.0F; }, everywhere, [](int x, int) { return x >= 128; }));
  const Layer made = blend.finish();
  for (int x = 40; x < 120; ++x) EXPECT_NEAR(std::abs(*made.at(x, 64) - 100), 40, 2) << x;
  for (int x = 136; x < 220; ++x) EXPECT_NEAR(*made.at(x, 64), 100, 2) << x;
}

/// The longest jump between neighbours along a line.
float steepest(const Layer& made, const std::function<const float*(int)>& at, int count) {
  float most = 0;
  for (int k = 0; k < count; ++k) most = std::max(most, std::abs(*at(k + 1) - *at(k)));
  EXPECT_EQ(made.grid(), kSphere);
  return most;
}

TEST(MultiBand, AStepInBrightness_BecomesARampEverywhereOnTheSphere) {
  // The seam runs around the sphere through both poles; one picture is 40 levels brighter.
  MultiBand blend(kSphere, Window::all(kSphere), 1, 2);
  const auto front = [](int x, int) { return x >= 64 && x < 192; };
  blend.add(picture([](int, int) { return 120.0F; }, everywhere, front));
  blend.add(picture([](int, int) { return 80.0F; }, everywhere, [&](int x, int y) { return !front(x, y); }));
  const Layer made = blend.finish();
  EXPECT_NEAR(*made.at(128, 64), 120, 6);
  EXPECT_NEAR(*made.at(0, 64), 80, 6);
  EXPECT_LT(steepest(
                made, [&](int k) { return made.at(k, 64); }, 255),
            5)
      << "the equator";
  // Around a pole, a pixel is tiny: neighbours must be nearly equal, or a star shows.
  EXPECT_LT(steepest(
                made, [&](int k) { return made.at(k, 0); }, 255),
            1)
      << "the pole";
  EXPECT_LT(steepest(
                made, [&](int k) { return made.at(k, 4); }, 255),
            2)
      << "close to the pole";
  EXPECT_NEAR(*made.at(0, 0), *made.at(128, 0), 4) << "across the pole";
}

TEST(MultiBand, APictureThatEndsAtTheSeam_IsNotDarkenedByItsEdge) {
  const auto front = [](int x, int) { return x >= 60 && x < 190; };
  const auto value = [](int x, int) { return 100 + 20 * std::sin(static_cast<float>(x) * 0.0245F); };
  MultiBand blend(kSphere, Window::all(kSphere), 1, 2);
  blend.add(picture(value, front, front));
  blend.add(picture(
      value, [&](int x, int y) { return !front(x, y); }, [&](int x, int y) { return !front(x, y); }));
  const Layer made = blend.finish();
  for (int y = 20; y < 108; ++y) {
    for (int x = 0; x < kSphere.width; ++x) ASSERT_NEAR(*made.at(x, y), value(x, y), 6) << x << ", " << y;
  }
}

TEST(MultiBand, AHole_IsTold) {
  const auto seen = [](int x, int) { return x < 200; };
  MultiBand blend(kSphere, Window::all(kSphere), 1, 2);
  blend.add(picture([](int, int) { return 100.0F; }, seen, seen));
  const Layer made = blend.finish();
  EXPECT_GT(made.at(100, 64)[1], 0);
  EXPECT_EQ(made.at(230, 64)[1], 0);
  EXPECT_NEAR(*made.at(199, 64), 100, 0.01) << "up to its edge";
}

TEST(MultiBand, ThreadsDoNotMatter) {
  const auto blended = [](int threads) {
    MultiBand blend(kSphere, Window::all(kSphere), 1, threads);
    const auto left = [](int x, int) { return x < 99; };
    blend.add(picture([](int x, int y) { return static_cast<float>((x * 31 + y * 17) % 200); }, everywhere, left));
    blend.add(picture([](int x, int y) { return static_cast<float>((x * 13 + y * 7) % 250); }, everywhere,
                      [&](int x, int y) { return !left(x, y); }));
    return blend.finish();
  };
  const Layer one = blended(1), three = blended(3);
  for (int y = 0; y < kSphere.height; ++y) {
    for (int x = 0; x < kSphere.width; ++x) ASSERT_EQ(*one.at(x, y), *three.at(x, y));
  }
}

}  // namespace
}  // namespace nodal::bands
