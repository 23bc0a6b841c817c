// Masks against geometry computed in another way.
#include "stitch/geometry/masks.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <cmath>
#include <numbers>
#include <random>

#include "stitch/geometry/mask_holes.h"
#include "stitch/geometry/rotation.h"

namespace nodal::geometry {
namespace {

using Polygon = std::vector<Region::Point>;

Masks masks_of(std::vector<Polygon> polygons) { return Masks(Region{0, 0, 100, 100, {}, std::move(polygons)}); }

TEST(Masks, OfASquare_DistanceIsToItsEdgesAndCorners) {
  for (const bool clockwise : {true, false}) {
    Polygon square{{20, 20}, {60, 20}, {60, 60}, {20, 60}};
    if (!clockwise) std::ranges::reverse(square);
    const Masks masks = masks_of({square});
    EXPECT_NEAR(masks.distance({40, 25}, 1e9), -5, 1e-12);
    EXPECT_NEAR(masks.distance({40, 40}, 1e9), -20, 1e-12);
    EXPECT_NEAR(masks.distance({70, 40}, 1e9), 10, 1e-12);
    EXPECT_NEAR(masks.distance({63, 64}, 1e9), 5, 1e-12);
    EXPECT_EQ(masks.distance({63, 64}, 2), 2) << "farther than asked for";
    EXPECT_NEAR(masks.distance({40, 25}, 2), -5, 1e-12);
  }
  EXPECT_TRUE(masks_of({}).empty());
  EXPECT_EQ(masks_of({}).distance({1, 1}, 7), 7);
}

TEST(Masks, EdgesThatCross_HideEveryPartThatTheyEnclose) {
  const Masks bow_tie = masks_of({{{10, 10}, {90, 90}, {90, 10}, {10, 90}}});
  EXPECT_LT(bow_tie.distance({20, 50}, 1e9), 0);
  EXPECT_LT(bow_tie.distance({80, 50}, 1e9), 0);
  EXPECT_GT(bow_tie.distance({50, 20}, 1e9), 0);
  Polygon star;  // the outline winds twice around its centre
  for (int k = 0; k < 5; ++k) {
    const double a = 4 * std::numbers::pi * k / 5;
    star.push_back({50 + 40 * std::sin(a), 50 - 40 * std::cos(a)});
  }
  EXPECT_LT(masks_of({star}).distance({50, 50}, 1e9), 0);
  EXPECT_LT(masks_of({star}).distance({50, 20}, 1e9), 0);
  EXPECT_GT(masks_of({star}).distance({50, 88}, 1e9), 0);
}

RC_GTEST_PROP(Masks, AnyPolygons_InsideIsWhereTheAnglesToTheCornersSumToATurn, (std::uint32_t seed)) {
  std::mt19937 random(seed);
  const auto draw = [&] { return static_cast<double>(random() % 400) / 4 - 10; };
  std::vector<Polygon> polygons(1 + random() % 3);
  for (Polygon& polygon : polygons) {
    polygon.resize(3 + random() % 6);
    for (Region::Point& corner : polygon) corner = {draw(), draw()};
  }
  const Masks masks = masks_of(polygons);
  for (int k = 0; k < 50; ++k) {
    const Pixel at{draw() + 0.0625, draw() + 0.03125};
    bool inside = false;
    double nearest = 1e9;
    for (const Polygon& polygon : polygons) {
      double turn = 0;
      for (std::size_t c = 0; c < polygon.size(); ++c) {
        const Region::Point a = polygon[c], b = polygon[(c + 1) % polygon.size()];
        turn += std::remainder(std::atan2(b.y - at.y, b.x - at.x) - std::atan2(a.y - at.y, a.x - at.x),
                               2 * std::numbers::pi);
        for (int step = 0; step <= 2000; ++step) {
          const double t = step / 2000.0;
          nearest = std::min(nearest, std::hypot(a.x + t * (b.x - a.x) - at.x, a.y + t * (b.y - a.y) - at.y));
        }
      }
      inside = inside || std::abs(turn) > 1;
    }
    if (nearest < 0.1) continue;  // on an edge the sum is unreliable
    const double distance = masks.distance(at, 1e9);
    RC_ASSERT((distance < 0) == inside);
    if (!inside) RC_ASSERT(std::abs(distance - nearest) < 0.05);
  }
}

Calibration pinholes() {
  Calibration rig;
  for (const double yaw : {0.0, 90.0}) {
    HeadCalibration head;
    head.name = rig.heads.empty() ? "front" : "right";
    head.width = head.height = 200;
    head.center_x = head.center_y = 100;
    head.lens = RectilinearLens{{100}};
    head.R_head_rig = rows_of(to_R_head_rig({yaw, 0, 0}));
    head.region = {0, 0, 200, 200, {}};
    head.vignetting = {100, 100, 100, {}};
    rig.heads.push_back(head);
  }
  return rig;
}

TEST(MaskHoles, ASquareInTheMiddle_IsNamedWithItsSolidAngle) {
  Calibration rig = pinholes();
  rig.heads[1].region.masks = {{{50, 50}, {150, 50}, {150, 150}, {50, 150}}};  // half as far out as the picture
  const std::vector<Head> heads = make_heads(rig).value();
  const std::vector<MaskHole> holes = find_mask_holes(heads);
  ASSERT_EQ(holes.size(), 1u);
  EXPECT_EQ(holes[0].head, 1u);
  const double t = 0.5;
  const double solid = 4 * std::atan(t * t / std::sqrt(1 + 2 * t * t));
  EXPECT_NEAR(holes[0].solid_angle_sr, solid, 0.01 * solid);
  EXPECT_NEAR(holes[0].towards.theta, std::numbers::pi / 2, 0.5);
  const std::string description = describe(holes, heads).at(0);
  EXPECT_NE(description.find("'right'"), std::string::npos) << description;
  EXPECT_NE(description.find(" sr ("), std::string::npos) << description;
}

TEST(MaskHoles, WhatAnotherHeadSees_IsNone) {
  Calibration rig = pinholes();
  rig.heads[1].region.masks = {{{50, 50}, {150, 50}, {150, 150}, {50, 150}}};
  rig.heads.push_back(rig.heads[1]);
  rig.heads[2].name = "beside";
  rig.heads[2].region.masks.clear();
  EXPECT_TRUE(find_mask_holes(make_heads(rig).value()).empty());
  EXPECT_TRUE(find_mask_holes(make_heads(pinholes()).value()).empty()) << "holes, but not of masks";
}

TEST(MaskedHead, OfAPlaceInAMask_ContainsItNot) {
  Calibration rig = pinholes();
  rig.heads[0].region.masks = {{{50, 50}, {150, 50}, {150, 150}, {50, 150}}};
  const Head head = Head::make(rig.heads[0]).value();
  EXPECT_FALSE(head.contains({100, 100}));
  EXPECT_TRUE(head.contains({40, 100}));
  EXPECT_NEAR(head.distance_to_edge({40, 100}), 10, 1e-12);
  EXPECT_NEAR(head.distance_to_edge({5, 100}), 5, 1e-12);
  EXPECT_NEAR(head.distance_to_edge_without_masks({100, 100}), 100, 1e-12);
}

}  // namespace
}  // namespace nodal::geometry
