// The inner loops against double-precision geometry, and their derivatives against finite differences.
#include "stitch/registration/tile_kernel.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <memory>
#include <random>

#include "stitch/geometry/head.h"
#include "stitch/geometry/rotation.h"
#include "stitch/registration/head_sight.h"
#include "tests/support/rigs.h"

namespace nodal::registration {
namespace {

constexpr int kWidth = 640, kHeight = 480;

HeadCalibration head_with(LensModel lens) {
  HeadCalibration head = test::plain_head("cam0", kWidth, kHeight);
  head.lens = std::move(lens);
  head.center_x = 331.5;
  head.center_y = 228.25;
  head.aspect = 1.083;
  head.R_head_rig = geometry::rows_of(geometry::to_R_head_rig({30, -20, 50}));
  head.vignetting = {335, 230, 400, {-0.2, -0.08, 0.01}};
  head.gain = {1.1, 1.1, 1.1};
  return head;
}

std::vector<HeadCalibration> every_lens() {
  return {head_with(TsaiLens{490, 2.29e-6, 1.65e-11}), head_with(RectilinearLens{{420, -12, 3}}),
          head_with(EquidistantLens{{260, 30, -12, 2}}), head_with(KannalaBrandtLens{250, {0.02, -0.004, 0, 0}})};
}

// A picture so smooth that differences between pixels are its derivatives.
std::vector<float> smooth_picture() {
  std::vector<float> values;
  for (int j = 0; j < kHeight; ++j) {
    for (int i = 0; i < kWidth; ++i) {
      values.push_back(static_cast<float>(120 + 60 * std::sin((i + 0.5) / 57) * std::cos((j + 0.5) / 71) +
                                          0.05 * (i + 0.5) - 0.03 * (j + 0.5)));
    }
  }
  return values;
}

// Rays over all that the head sees.
Tile rays_of(const geometry::Head& head) {
  Tile tile{};
  std::mt19937 random(7);
  std::uniform_real_distribution<double> across(40, kWidth - 40), down(40, kHeight - 40);
  for (int i = 0; i < kTile; ++i) {
    const geometry::Ray ray = *head.unproject({across(random), down(random)});
    tile.x[i] = static_cast<float>(ray.x());
    tile.y[i] = static_cast<float>(ray.y());
    tile.z[i] = static_cast<float>(ray.z());
    tile.omega[i] = 1e-5F;
  }
  return tile;
}

struct Seen {
  HeadState state;
  RadialTable table;
  HeadSight sight;
};

Seen see(const HeadState& state, const std::vector<float>& picture) {
  Seen seen;
  seen.state = state;
  const double angle = *state.used_angle();
  seen.table = *RadialTable::make(state.lens, angle, state.edge_angle, state.edge_radius, true);
  seen.sight = sight_of(state, seen.table, angle, {{picture.data(), kWidth, kHeight}}, 1, 0);
  seen.sight.channels = {0};
  return seen;
}

TEST(Kernel, EveryLens_ProjectsWhereDoublePrecisionGeometryDoes) {
  const std::vector<float> picture = smooth_picture();
  for (const HeadCalibration& calibration : every_lens()) {
    const geometry::Head head = *geometry::Head::make(calibration);
    const Tile tile = rays_of(head);
    Seen seen = see(*HeadState::from(calibration), picture);
    seen.sight.table = &seen.table;
    const auto out = std::make_unique<TileHead>();
    ASSERT_TRUE(project(seen.sight, tile, *out));
    for (int i = 0; i < kTile; ++i) {
      const geometry::Pixel at = *head.project(geometry::Ray::towards(
          static_cast<double>(tile.x[i]), static_cast<double>(tile.y[i]), static_cast<double>(tile.z[i])));
      EXPECT_NEAR(out->u[i], at.x, 2e-3);
      EXPECT_NEAR(out->v[i], at.y, 2e-3);
      EXPECT_NEAR(out->weight[i] / head.density(at), 1, 0.01);
      EXPECT_NEAR(out->falloff[i], head.vignetting(at), 1e-4);
    }
  }
}

TEST(Kernel, EverySoughtNumberOfEveryLens_DerivativeIsTheFiniteDifference) {
  const std::vector<float> picture = smooth_picture();
  Sought all;
  all.focal = all.lens = all.aspect = true;
  for (const HeadCalibration& calibration : every_lens()) {
    const Tile tile = rays_of(*geometry::Head::make(calibration));
    const HeadState state = *HeadState::from(calibration);
    const Slots slots = slots_of(all, radial_count(state.lens));
    const auto light_at = [&](const HeadState& where) {
      Seen seen = see(where, picture);
      seen.sight.table = &seen.table;
      auto out = std::make_unique<TileHead>();
      EXPECT_TRUE(project(seen.sight, tile, *out));
      sample(seen.sight, 0, *out);
      return out;
    };
    Seen seen = see(state, picture);
    seen.sight.table = &seen.table;
    const auto here = light_at(state);
    differentiate(seen.sight, slots, 0, *here);
    for (int k = 0; k < slots.count; ++k) {
      // A step that moves the picture by half a pixel, or changes its light by a percent.
      const bool turn = k < slots.focal, ratio = k == slots.focal || k == slots.aspect, light = k >= slots.gain;
      const double step = turn ? 1e-3 : ratio ? 2e-3 : light ? 0.01 : 0.5;
      Eigen::VectorXd by = Eigen::VectorXd::Zero(slots.count);
      by[k] = step;
      const auto above = light_at(moved(state, slots, by)), below = light_at(moved(state, slots, -by));
      double error = 0, size = 0;
      for (int i = 0; i < kTile; ++i) {
        if (above->weight[i] <= 0 || below->weight[i] <= 0) continue;
        const double difference = static_cast<double>(above->light[i] - below->light[i]) / (2 * step);
        error += std::pow(difference - static_cast<double>(here->J[k][i]), 2);
        size += difference * difference;
      }
      ASSERT_GT(size, 0);
      EXPECT_LT(std::sqrt(error / size), 0.02) << "lens " << calibration.lens.index() << ", number " << k;
    }
  }
}

TEST(Kernel, TwoHeadsWithOnePictureEach_OthersGradientIsTheOwnWhenTheyStandAlike) {
  const std::vector<float> picture = smooth_picture();
  Sought all;
  all.focal = all.lens = all.aspect = true;
  for (const HeadCalibration& calibration : every_lens()) {
    const Tile tile = rays_of(*geometry::Head::make(calibration));
    const HeadState state = *HeadState::from(calibration);
    const Slots slots = slots_of(all, radial_count(state.lens));
    Seen seen = see(state, picture);
    seen.sight.table = &seen.table;
    const auto a = std::make_unique<TileHead>(), b = std::make_unique<TileHead>();
    a->head = 0;
    b->head = 1;
    for (TileHead* each : {a.get(), b.get()}) {
      ASSERT_TRUE(project(seen.sight, tile, *each));
      sample(seen.sight, 0, *each);
      differentiate(seen.sight, slots, 0, *each);
    }
    TileHead* const both[] = {a.get(), b.get()};
    differentiate_by_others({seen.sight, seen.sight}, {slots, slots}, both, 2);
    for (int k = 0; k < slots.count; ++k) {
      double error = 0, size = 0;
      for (int i = 0; i < kTile; ++i) {
        error += std::pow(static_cast<double>(a->J[k][i] - a->J_others[k][i]), 2);
        size += std::pow(static_cast<double>(a->J[k][i]), 2);
      }
      EXPECT_LT(std::sqrt(error / size), 1e-3) << "lens " << calibration.lens.index() << ", number " << k;
    }
  }
}

TEST(Kernel, MaxNorm_OnlyTheWorstHeadCountsAndHuberTakesTheTail) {
  const auto heads = std::make_unique<std::array<TileHead, 3>>();
  Tile tile{};
  TileHead* pointers[3];
  for (int h = 0; h < 3; ++h) {
    pointers[h] = &(*heads)[static_cast<std::size_t>(h)];
    for (int i = 0; i < kTile; ++i) {
      pointers[h]->weight[i] = 1;
      pointers[h]->light[i] = static_cast<float>(h == 0 ? 10 : h == 1 ? 11 : 18);  // mean 13: -3, -2, 5
    }
  }
  for (float& omega : tile.omega) omega = 1;
  const auto rays = std::make_unique<TileRays>();
  ASSERT_TRUE(compare(pointers, 3, tile, 0, false, *rays));
  EXPECT_FLOAT_EQ(rays->cost[5], 9 + 4 + 25);
  ASSERT_TRUE(compare(pointers, 3, tile, 0, true, *rays));
  EXPECT_FLOAT_EQ(rays->cost[5], 25);
  EXPECT_FLOAT_EQ(pointers[0]->active[5], 0);
  EXPECT_FLOAT_EQ(pointers[2]->active[5], 1);
  // Huber's norm of the ray's rms difference d = sqrt(38/3): 3 (2 k d - k^2) above k.
  ASSERT_TRUE(compare(pointers, 3, tile, 2, false, *rays));
  EXPECT_NEAR(rays->cost[5], 3 * (2 * 2 * std::sqrt(38.0 / 3) - 4), 1e-4);
}

}  // namespace
}  // namespace nodal::registration
