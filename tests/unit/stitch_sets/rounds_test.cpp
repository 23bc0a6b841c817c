// The rounds of work of a set: their order, and that the order of their pieces does not matter.
#include <gtest/gtest.h>

#include "film.h"

namespace nodal::sets {
namespace {

using Kind = Round::Kind;

TEST(Rounds, AreHandedOutInTheirOnlyOrder) {
  const test::RenderedRig seen = test::render_rig(test::six_fisheyes(96), hal::sim::town_square_scene(3));
  SetBlend blend;
  blend.adopt(with_memory(plan_of(seen.truth, SeamPlacement::kPlaced)));
  const auto expect_round = [&](Kind kind, std::size_t pieces) {
    const auto round = blend.next_round();
    ASSERT_TRUE(round);
    EXPECT_EQ(round->kind, kind);
    EXPECT_EQ(round->pieces, pieces);
    for (std::size_t piece = 0; piece < pieces; ++piece) blend.run(piece);
  };
  Bytes raymap(std::size_t{kWidth} * kWidth / 2);
  for (const bool views : {false, true}) {
    std::vector<SetFrame> set = set_of(seen);
    set[2] = {};
    EXPECT_EQ(blend.begin(set, views), 0U);
    if (views) expect_round(Kind::kView, 5);
    EXPECT_FALSE(blend.next_round()) << "grey frames are not decoded";
    EXPECT_EQ(blend.views() != nullptr, views);
    blend.begin_raymap(0, raymap.data());
    expect_round(Kind::kPrepare, 5);
    expect_round(Kind::kBlend, kWidth / 2 / SetBlend::kBandRows);
    EXPECT_FALSE(blend.next_round());
    EXPECT_FALSE(blend.next_round()) << "until the next raymap begins";
  }
}

TEST(Rounds, PiecesInAnyOrder_GiveTheSameBytes) {
  const test::RenderedRig seen = test::render_rig(test::six_fisheyes(96), hal::sim::town_square_scene(3));
  const PlanPtr plan = plan_of(seen.truth, SeamPlacement::kPlaced);
  const auto blended = [&](const auto& share) {
    SetBlend blend;
    blend.adopt(with_memory(plan));
    blend.begin(set_of(seen), true);
    blend.run_rounds(share);
    Bytes raymap(std::size_t{kWidth} * kWidth / 2);
    blend.begin_raymap(0, raymap.data());
    blend.run_rounds(share);
    return std::pair(raymap, blend.views()->views);
  };
  const auto forwards = blended([](int pieces, const auto& work) {
    for (int i = 0; i < pieces; ++i) work(i);
  });
  const auto backwards = blended([](int pieces, const auto& work) {
    for (int i = pieces; i-- > 0;) work(i);
  });
  EXPECT_TRUE(forwards == backwards);
}

}  // namespace
}  // namespace nodal::sets
