#include "hal/sim/scene/scene.h"

#include <gtest/gtest.h>

#include <cmath>
#include <utility>
#include <vector>

#include "hal/sim/scene/plate.h"
#include "protocol/base/angles.h"

namespace nodal::hal::sim {
namespace {

Direction at(double theta, double phi) {
  return {std::sin(theta) * std::cos(phi), std::sin(phi), std::cos(theta) * std::cos(phi)};
}

/// A grey photograph of width 2n, height n, from a function of the pixel.
template <class Rule>
ScenePtr photo(int n, Rule rule) {
  std::vector<std::uint8_t> grey;
  for (int y = 0; y < n; ++y) {
    for (int x = 0; x < 2 * n; ++x) grey.push_back(static_cast<std::uint8_t>(rule(x, y)));
  }
  return photo_scene(packed_image(PixelFormat::kGrey8, 2 * n, n, std::as_const(grey).data()), Response{}).value();
}

TEST(ConstantScene, EveryDirection_IsTheSameLight) {
  const ScenePtr scene = constant_scene({0.1F, 0.2F, 0.3F});
  for (int i = 0; i < 20; ++i) EXPECT_EQ(scene->light(at(i, i * 0.1 - 1), 0.01).g, 0.2F);
  EXPECT_TRUE(scene->movers().empty());
}

// theta = atan2(x, z): the middle column is forward, a quarter further is right; phi grows down the rows.
TEST(PhotoScene, OnePixelBright_IsSeenInItsDirectionOnly) {
  const int n = 64;
  for (const auto& [x, y] : {std::pair{64, 32}, {96, 32}, {32, 32}, {64, 8}, {0, 40}, {127, 50}}) {
    const ScenePtr scene = photo(n, [&](int i, int j) { return i == x && j == y ? 255 : 0; });
    const double theta = ((x + 0.5) / (2 * n) - 0.5) * 2 * kPi;
    const double phi = ((y + 0.5) / n - 0.5) * kPi;
    EXPECT_NEAR(scene->light(at(theta, phi), 1e-4).r, 1, 1e-3);
    EXPECT_NEAR(scene->light(at(theta + 3 * kPi / n, phi), 1e-4).r, 0, 1e-3);
    EXPECT_NEAR(scene->light(at(theta, phi > 0 ? phi - 3 * kPi / n : phi + 3 * kPi / n), 1e-4).r, 0, 1e-3);
  }
}

TEST(PhotoScene, ConstantPhotograph_IsConstantOverThePolesAndTheSeamToo) {
  const ScenePtr scene = photo(32, [](int, int) { return 100; });
  for (const double phi : {-kPi / 2, -1.56, 0.0, 1.56, kPi / 2}) {
    for (const double theta : {-kPi, -3.14, 0.0, 3.14, kPi}) {
      for (const double footprint : {1e-4, 0.3, 2.0}) {
        EXPECT_NEAR(scene->light(at(theta, phi), footprint).b * 255, 100, 1e-3);
      }
    }
  }
}

// cos(theta) has one period over the width, so the photograph is smooth across its edges as well.
TEST(PhotoScene, SmoothPhotograph_IsInterpolatedToItsFormula) {
  const int n = 256;
  const ScenePtr scene = photo(n, [&](int i, int j) {
    const double theta = ((i + 0.5) / (2 * n) - 0.5) * 2 * kPi;
    const double phi = ((j + 0.5) / n - 0.5) * kPi;
    return std::lround(127.5 + 120 * std::cos(theta) * std::cos(phi));
  });
  for (int k = 0; k < 500; ++k) {
    const Direction d = at(k * 0.377, 1.5 * std::sin(k * 1.3));
    EXPECT_NEAR(scene->light(d, 1e-3).g * 255, 127.5 + 120 * d.z, 0.8);
  }
}

TEST(PhotoScene, EncodedValues_BecomeLinearLight) {
  std::vector<std::uint8_t> rgb(3 * 32 * 16, 188);
  const auto scene = photo_scene(packed_image(PixelFormat::kRgb24, 32, 16, std::as_const(rgb).data()),
                                 Response{Response::Curve::kSrgb, 1, {}});
  EXPECT_NEAR(scene.value()->light({0, 0, 1}, 0.01).r, 0.5029, 1e-3);  // sRGB 188
}

TEST(PhotoScene, WrongShapeOrFormat_SaysWhatIsWanted) {
  std::vector<std::uint8_t> bytes(3 * 64 * 64);
  const auto square = photo_scene(packed_image(PixelFormat::kRgb24, 64, 64, std::as_const(bytes).data()), Response{});
  ASSERT_FALSE(square);
  EXPECT_EQ(square.error().code, Errc::kBadValue);
  EXPECT_NE(square.error().message.find("twice as wide"), std::string::npos);
  const auto yuv = photo_scene(packed_image(PixelFormat::kI420, 64, 32, std::as_const(bytes).data()), Response{});
  ASSERT_FALSE(yuv);
  EXPECT_EQ(yuv.error().code, Errc::kUnsupported);
}

// At the poles the light must not depend on theta.
TEST(TownSquare, RoundThePoles_TheLightIsContinuous) {
  const ScenePtr scene = town_square_scene();
  for (const double phi : {-kPi / 2 + 1e-5, kPi / 2 - 1e-5}) {
    const Light first = scene->light(at(0, phi), 1e-3);
    for (int i = 0; i < 100; ++i) {
      // The points of the compass star meet below: only red and sand are there.
      const Light light = scene->light(at(i * 0.0628, phi), 1e-3);
      EXPECT_NEAR(light.r, first.r, 0.12);
    }
  }
}

TEST(TownSquare, SkyAboveGroundBelow_AndLightIsFiniteAndPositiveEverywhere) {
  const ScenePtr scene = town_square_scene();
  double above = 0;
  double below = 0;
  for (int i = 0; i < 20'000; ++i) {
    const Direction d = at(i * 0.61803, std::asin(2.0 * ((i * 0.754877) - std::floor(i * 0.754877)) - 1));
    const Light light = scene->light(d, 2e-3);
    ASSERT_TRUE(std::isfinite(light.r) && std::isfinite(light.g) && std::isfinite(light.b));
    ASSERT_GE(std::min({light.r, light.g, light.b}), -1e-6F);
    (d.y < 0 ? above : below) += light.b - light.r;
  }
  EXPECT_GT(above, 0) << "sky is bluer than red";
  EXPECT_GT(above, below);
}

// Registration and stitching need structure in every direction.
TEST(TownSquare, EveryPartOfTheSphere_HasContrast) {
  const ScenePtr scene = town_square_scene();
  for (int part = 0; part < 60; ++part) {
    const double theta = part * 2.39996;
    const double phi = std::asin(2.0 * (part + 0.5) / 60 - 1);
    double least = 1e9;
    double most = -1e9;
    for (int i = 0; i < 400; ++i) {
      const double g = scene->light(at(theta + 0.02 * (i % 20) / std::cos(phi), phi + 0.02 * (i / 20 - 10)), 2e-3).g;
      least = std::min(least, g);
      most = std::max(most, g);
    }
    EXPECT_GT(most - least, 0.04) << "about theta " << theta << ", phi " << phi;
  }
}

TEST(TownSquare, SameSeed_IsTheSamePlace) {
  const ScenePtr a = town_square_scene(7);
  const ScenePtr b = town_square_scene(7);
  for (int i = 0; i < 200; ++i) {
    const Direction d = at(i * 0.31, std::sin(i));
    EXPECT_EQ(a->light(d, 1e-3).g, b->light(d, 1e-3).g);
  }
}

TEST(Movers, AfterAPeriod_AreWhereTheyWere) {
  const ScenePtr scene = town_square_scene();
  ASSERT_FALSE(scene->movers().empty());
  for (const Mover& mover : scene->movers()) {
    const PlacedMover start(mover, Instant{});
    const Direction toward = mover.start;
    EXPECT_GT(start.cover(toward, 1e-3).share, 0.99F) << "it covers its own middle";
    const Duration turn = mover.period < Duration{} ? -mover.period : mover.period;
    EXPECT_GT(PlacedMover(mover, Instant{} + turn * 3).cover(toward, 1e-3).share, 0.99F);
    EXPECT_EQ(PlacedMover(mover, Instant{} + turn / 2).cover(toward, 1e-3).share, 0.0F) << "half way it is elsewhere";
    EXPECT_EQ(start.cover({-toward.x, -toward.y, -toward.z}, 1e-3).share, 0.0F);
  }
}

// The share of a fine grid that a ball covers equals the solid angle of its cap.
TEST(Movers, Covered_IsTheSolidAngleOfTheBall) {
  const Mover mover{{0, 1, 0}, {0, 0, 1}, Duration::seconds(10), 0.05, {1, 1, 1}, {0, 0, 0}};
  const PlacedMover placed(mover, Instant{});
  double covered = 0;
  const double step = 5e-4;
  for (double v = -0.08; v < 0.08; v += step) {
    for (double u = -0.08; u < 0.08; u += step) {
      const double n = std::sqrt(1 + u * u + v * v);
      covered += placed.cover({u / n, v / n, 1 / n}, 1e-3).share * step * step / (n * n * n);
    }
  }
  EXPECT_NEAR(covered / (2 * kPi * (1 - std::cos(0.05))), 1, 0.01);
}

// Between meridians 0.2 rad apart there are 0.4 steradians, from pole to pole.
TEST(BarScene, AtAnyTime_CoversItsLuneOfTheSphereAboutWhereItHasTurnedTo) {
  const double tilt = 0.3;
  const ScenePtr scene = bar_scene({std::sin(tilt), std::cos(tilt), 0}, Duration::seconds(4), 0.1);
  const PlacedMover placed(scene->movers()[0], Instant{} + Duration::milliseconds(500));  // an eighth of a turn
  double covered = 0;
  const double step = kPi / 1000;
  for (double v = -kPi / 2 + step / 2; v < kPi / 2; v += step) {
    for (double u = -kPi; u < kPi; u += step) covered += placed.cover(at(u, v), 1e-3).share * step * step * std::cos(v);
  }
  EXPECT_NEAR(covered, 0.4, 0.002);
  // Its middle starts at z, perpendicular to the axis, and has turned by 45 degrees to the right.
  const Direction middle{std::sqrt(0.5) * std::cos(tilt), -std::sqrt(0.5) * std::sin(tilt), std::sqrt(0.5)};
  EXPECT_EQ(placed.cover(middle, 1e-3).share, 1.0F);
  EXPECT_EQ(placed.cover({-middle.x, -middle.y, -middle.z}, 1e-3).share, 0.0F);
  for (double u = -kPi; u < kPi; u += 0.01) {
    for (double v = -1.5; v < 1.5; v += 0.05) {
      if (placed.cover(at(u, v), 1e-3).share > 0) {
        ASSERT_TRUE(placed.may_touch(at(u, v), 1, 0));
      }
    }
  }
}

}  // namespace
}  // namespace nodal::hal::sim
