// Pictures of a rendered town compared with right and wrong rotations.
#include "stitch/autocalibration/overlap.h"

#include <gtest/gtest.h>

#include "stitch/geometry/head.h"
#include "stitch/geometry/rotation.h"
#include "tests/support/rendered_rig.h"

namespace nodal::autocalibration {
namespace {

TEST(Overlap, RightRotations_AreToldFromWrongOnes) {
  const test::RenderedRig rig =
      test::render_rig(test::six_fisheyes(400, 150), hal::sim::town_square_scene(3), {.noise_levels = 1});
  std::vector<Shape> shapes;
  std::vector<Picture> small;
  for (std::size_t h = 0; h < 6; ++h) {
    shapes.push_back({400, 400, rig.truth.heads[h].region.circle});
    small.push_back(reduced({PixelFormat::kGrey8, 400, 400, rig.bytes[h]}, kEdgeSide));
  }
  const Overlaps overlaps(shapes, small);
  const SharedLens lens{{1 / (75 * 3.14159265 / 180), {}}};
  const std::vector<geometry::Head> heads = geometry::make_heads(rig.truth).value();
  const Eigen::Matrix3d away = geometry::to_R_head_rig({25, 10, 0});
  int pairs = 0;
  for (std::size_t a = 0; a < 6; ++a) {
    for (std::size_t b = a + 1; b < 6; ++b) {
      const Eigen::Matrix3d R_b_a = heads[b].R_head_rig() * heads[a].R_head_rig().transpose();
      if (std::abs((R_b_a * Eigen::Vector3d::UnitZ()).z()) > 0.5) continue;  // opposite heads share nothing
      ++pairs;
      EXPECT_GT(overlaps.correlation(a, b, R_b_a, lens, lens), 0.7) << a << " " << b;
      EXPECT_LT(overlaps.correlation(a, b, R_b_a * away, lens, lens), 0.3) << a << " " << b;
    }
  }
  EXPECT_EQ(pairs, 12);
}

TEST(Overlap, TooFewRaysOrNoDetail_DoNotCount) {
  const std::vector<Shape> shapes(2, Shape{100, 100, {}});
  const Picture flat{100, 100, std::vector<float>(10000, 90)}, tiny{1, 1, {90}};
  const SharedLens lens{{1 / 0.6, {}}};
  const Eigen::Matrix3d apart = geometry::to_R_head_rig({180, 0, 0});
  EXPECT_EQ(Overlaps(shapes, {flat, flat}).correlation(0, 1, apart, lens, lens), Overlaps::kCannotTell)
      << "no ray is shared";
  EXPECT_EQ(Overlaps(shapes, {tiny, tiny}).correlation(0, 1, Eigen::Matrix3d::Identity(), lens, lens),
            Overlaps::kCannotTell);
  EXPECT_EQ(Overlaps(shapes, {flat, flat}).correlation(0, 1, Eigen::Matrix3d::Identity(), lens, lens),
            Overlaps::kCannotTell)
      << "no detail";
}

}  // namespace
}  // namespace nodal::autocalibration
