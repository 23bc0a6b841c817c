// Placed seams as a rig has them: views of the heads' pictures on a small map, and tables that are refused.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "film.h"
#include "stitch/geometry/head.h"
#include "stitch/geometry/raymap/layout.h"
#include "stitch/sets/seam_views.h"

namespace nodal::sets {
namespace {

TEST(PlacedSeams, Views_AreWhatTheHeadsSee) {
  const hal::sim::ScenePtr town = hal::sim::town_square_scene(3);
  const test::RenderedRig seen = test::render_rig(test::six_fisheyes(160), town);
  Film film(seen.truth, SeamPlacement::kPlaced);
  film.blend(set_of(seen));
  const SeamPictures& pictures = *film.newest_views;
  EXPECT_EQ(pictures.heads, 0b111111U);
  const auto layout = geometry::make_layout("equirectangular", kSeamMapWidth, kSeamMapWidth / 2).value();
  const auto heads = geometry::make_heads(seen.truth).value();
  // The mean difference from the scene, of a view that is moved by some columns.
  const auto difference = [&](std::size_t h, int moved) {
    double off = 0, count = 0;
    for (std::size_t p = 0; p < pictures.views[h].size(); ++p) {
      const int x = static_cast<int>(p) % kSeamMapWidth, y = static_cast<int>(p) / kSeamMapWidth;
      const auto ray = layout->ray(x + 0.5, y + 0.5);
      const auto at = heads[h].project(*ray);
      if (!at || heads[h].distance_to_edge(*at) < 6 || x + moved < 0 || x + moved >= kSeamMapWidth) continue;
      const Eigen::Vector3d d = ray->direction();
      const hal::sim::Light light = town->light({d.x(), d.y(), d.z()}, 0.02);
      off += std::abs(pictures.views[h][p + static_cast<std::size_t>(moved)] -
                      255 * std::clamp(0.299 * light.r + 0.587 * light.g + 0.114 * light.b, 0.0, 1.0));
      ++count;
    }
    return off / count;
  };
  for (std::size_t h = 0; h < heads.size(); ++h) {
    EXPECT_LT(difference(h, 0), 10) << h;
    EXPECT_LT(difference(h, 0), difference(h, 1)) << h;
    EXPECT_LT(difference(h, 0), difference(h, -1)) << h;
  }
}

TEST(PlacedSeams, HeadsWithOtherExposures_AreComparedAsIfTheyHadTheSame) {
  const hal::sim::ScenePtr town = hal::sim::town_square_scene(3);
  test::RenderedRig seen = test::render_rig(test::six_fisheyes(160), town);
  for (std::uint8_t& sample : seen.bytes[1]) sample /= 2;
  const auto difference = [&](std::int64_t exposure_of_head_1_us) {
    std::vector<SetFrame> set = set_of(seen);
    set[1].exposure = Exposure::microseconds(exposure_of_head_1_us);
    Film film(seen.truth, SeamPlacement::kPlaced);
    film.blend(set);
    const SeamPictures& pictures = *film.newest_views;
    double off = 0, count = 0;
    for (std::size_t p = 0; p < pictures.views[0].size(); ++p) {
      if (pictures.views[0][p] == 0 || pictures.views[1][p] == 0) continue;
      off += std::abs(pictures.views[0][p] - pictures.views[1][p]);
      ++count;
    }
    return off / count;
  };
  EXPECT_GT(difference(8000), 15) << "half the numbers with the same exposure";
  EXPECT_LT(difference(4000), 8) << "a linear response: half the light, half the numbers";
}

/// A table that would not pass its proof never comes into force; the old seams stay.
TEST(PlacedSeams, ATableThatFailsItsProof_IsRefusedWithTheReason) {
  const test::RenderedRig seen = test::render_rig(test::six_fisheyes(160), hal::sim::town_square_scene(3));
  Film film(seen.truth, SeamPlacement::kPlaced);
  film.blend(set_of(seen));
  const PlacedSeams good = place_seams(film.now(), *film.newest_views);
  ASSERT_TRUE(good.plan);
  EXPECT_EQ(good.refused, "");
  BlendPlan broken = film.now();
  for (blend::PatchRecord& record : broken.tables[0].cover[0].records) {
    if (!record.listed()) record.x[0] = 20'000;  // far outside of the picture
  }
  const PlacedSeams refused = place_seams(broken, *film.newest_views);
  EXPECT_FALSE(refused.plan);
  EXPECT_NE(refused.refused.find("blend table"), std::string::npos) << refused.refused;
}

}  // namespace
}  // namespace nodal::sets
