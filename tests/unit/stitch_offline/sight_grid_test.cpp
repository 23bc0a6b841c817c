// Interpolated sights against the projection of every pixel.
#include "stitch/offline/sight_grid.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "tests/support/rendered_rig.h"

namespace nodal::offline {
namespace {

constexpr bands::Grid kGrid{2050, 1025};  // the last cells are narrower than the others

HeadView view_of(const HeadCalibration& head) { return {geometry::Head::make(head).value(), PixelFormat::kGrey8, 1}; }

/// Heads of a fisheye: one that looks at the horizon, and one at the pole, where a grid's columns are narrow.
HeadCalibration fisheye(bool at_pole) {
  HeadCalibration head = test::six_fisheyes(640).heads[0];
  if (at_pole) head.R_head_rig = {1, 0, 0, 0, 0, 1, 0, -1, 0};
  return head;
}

constexpr int kAround = 512;

struct Compared {
  double farthest_px = 0;
  int seen = 0, differ = 0;
};

Compared compare(const HeadView& head, const HeadPicture::Moved& moved, const SightGrid& sights) {
  Compared sum;
  for (int y = 0; y < kGrid.height; ++y) {
    for (int x = 0; x < kGrid.width; ++x) {
      // Centres of pixels, and other places in them.
      const double u = x + (y % 2 == 0 ? 0.5 : 0.125), v = y + (x % 3 == 0 ? 0.5 : 0.875);
      const auto exact = head.see(moved(ray_of(kGrid, u, v)));
      const auto near = sights.near(u, v);
      sum.seen += exact.has_value();
      sum.differ += exact.has_value() != near.has_value();
      if (!exact || !near) continue;
      sum.farthest_px =
          std::max(sum.farthest_px, std::hypot(exact->pixel.x - near->pixel.x, exact->pixel.y - near->pixel.y));
    }
  }
  return sum;
}

Eigen::Vector3d as_it_is(const Eigen::Vector3d& ray) { return ray; }

/// Up and down by up to a degree, in waves of 60 degrees, as flow moves rays.
Eigen::Vector3d waved(const Eigen::Vector3d& ray) {
  return (ray + Eigen::Vector3d(0, 0.0175 * std::sin(6 * ray.x()), 0)).normalized();
}

TEST(SightGrid, AFisheyeAtTheHorizonAndAtThePole_IsSeenWhereItIsAndIsMostlyInterpolated) {
  for (const bool at_pole : {false, true}) {
    const HeadView head = view_of(fisheye(at_pole));
    for (const auto& moved : {as_it_is, waved}) {
      const SightGrid sights(head, moved, kGrid, head.window(kGrid), kAround, parallel::Workers(2));
      const Compared found = compare(head, moved, sights);
      EXPECT_GT(found.seen, 100000);
      EXPECT_EQ(found.differ, 0) << at_pole;
      EXPECT_LT(found.farthest_px, 2 * SightGrid::kMaxOffPx) << at_pole;
      EXPECT_GT(sights.interpolated(), 0.2) << at_pole;
    }
  }
}

TEST(SightGrid, MasksSmallerThanCells_HideTheirPixels) {
  // At 16 places, so that some are between the points at which cells are looked at.
  HeadCalibration head = fisheye(false);
  for (int k = 0; k < 16; ++k) {
    const double x = 200 + 67.3 * (k % 4), y = 200 + 61.7 * (k / 4), side = 1.5;
    head.region.masks.push_back({{x, y}, {x + side, y}, {x + side, y + side}, {x, y + side}});
  }
  const HeadView view = view_of(head);
  const SightGrid sights(view, as_it_is, kGrid, view.window(kGrid), kAround, parallel::Workers(1));
  EXPECT_EQ(compare(view, as_it_is, sights).differ, 0);
}

/// Waves as short as a few cells.
Eigen::Vector3d rippled(const Eigen::Vector3d& ray) {
  return (ray + Eigen::Vector3d(0, 0.0175 * std::sin(150 * ray.x()), 0)).normalized();
}

TEST(SightGrid, RaysThatMoveMoreThanCellsShow_AreNotInterpolated) {
  const HeadView head = view_of(fisheye(false));
  const SightGrid sights(head, rippled, kGrid, head.window(kGrid), kAround, parallel::Workers(2));
  // Interpolated, they would be off by half of what they move, which is 3 px.
  EXPECT_LT(compare(head, rippled, sights).farthest_px, 0.3);
}

TEST(SightGrid, AWindowAcrossTheGridsEdge_ShowsWhatTheWholeGridShows) {
  HeadCalibration behind = fisheye(false);
  behind.R_head_rig = {-1, 0, 0, 0, 1, 0, 0, 0, -1};
  const HeadView head = view_of(behind);
  const parallel::Workers workers(1);
  const SightGrid whole(head, as_it_is, kGrid, bands::Window::all(kGrid), kAround, workers);
  const bands::Window part{kGrid.width - 301, 397, 555, 211};
  const SightGrid sights(head, as_it_is, kGrid, part, kAround, workers);
  double farthest = 0;
  for (int j = 0; j < part.height; ++j) {
    for (int i = 0; i < part.width; ++i) {
      const int x = (part.x + i) % kGrid.width, y = part.y + j;
      ASSERT_TRUE(sights.at(x, y));
      const geometry::Pixel here = sights.at(x, y)->pixel, expected = whole.at(x, y)->pixel;
      farthest = std::max(farthest, std::hypot(here.x - expected.x, here.y - expected.y));
    }
  }
  EXPECT_LT(farthest, 1e-9);
  EXPECT_FALSE(sights.at(part.x - 1, 400));
  EXPECT_FALSE(sights.at(kGrid.width / 2, 400));
}

TEST(SightGrid, AnEmptyWindow_ShowsNothing) {
  const HeadView head = view_of(fisheye(false));
  const SightGrid sights(head, as_it_is, kGrid, {}, kAround, parallel::Workers(1));
  EXPECT_FALSE(sights.at(kGrid.width / 2, kGrid.height / 2));
  EXPECT_EQ(sights.interpolated(), 0);
}

}  // namespace
}  // namespace nodal::offline
