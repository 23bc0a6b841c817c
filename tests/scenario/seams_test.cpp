// Whole rigs with placed seams.
#include <gtest/gtest.h>

#include "protocol/base/field.h"
#include "tests/scenario/stand.h"

namespace nodal::scenario {
namespace {

StandOptions placed() {
  StandOptions options;
  options.config.raymap.seams = SeamPlacement::kPlaced;
  options.world.scene = hal::sim::town_square_scene(3);
  return options;
}

std::vector<Pulled> film(Stand& stand, TestHost& host, std::uint64_t count) {
  const StreamId stream = host.pull(false, count, true);
  EXPECT_NE(stream, 0u) << host.refusal.message();
  EXPECT_TRUE(stand.run_until([&] { return host.closed.count(stream) != 0; }));
  return host.pulled[stream];
}

void expect_same(const std::vector<Pulled>& a, const std::vector<Pulled>& b) {
  ASSERT_EQ(a.size(), b.size());
  for (std::size_t k = 0; k < a.size(); ++k) EXPECT_EQ(a[k].body, b[k].body) << "raymap " << k;
}

const firmware::Blender::Counts& counts(Stand& stand) { return stand.rig->blender().counts(); }

TEST(PlacedSeams, ARig_PlacesThemAndMakesTheSameRaymapsOnEveryRun) {
  Stand first(placed()), second(placed());
  StandOptions as_fixed = placed();
  as_fixed.config.raymap.seams = SeamPlacement::kFixed;
  Stand fixed(as_fixed);
  const auto raymaps = film(first, first.bring_up(), 40);
  expect_same(raymaps, film(second, second.bring_up(), 40));
  EXPECT_GE(counts(first).seams_moved.load(), 1u);
  EXPECT_EQ(counts(first).seams_late.load(), 0u);
  const auto unmoved = film(fixed, fixed.bring_up(), 40);
  EXPECT_NE(raymaps.back().body, unmoved.back().body);
  EXPECT_EQ(counts(fixed).seams_moved.load(), 0u);
}

TEST(PlacedSeams, HeadsThatAreDecodedAndFields_HaveThemToo) {
  StandOptions options = placed();
  options.config.raymap.format = PixelFormat::kI420;
  options.config.raymap.fields = FieldUse::kSeparate;
  for (firmware::HeadConfig& head : options.config.heads) {
    head.format = PixelFormat::kI422;
    head.fields = Fields::kBottomFirst;
  }
  options.world.head.pixels = PixelFormat::kI422;
  options.world.head.fields = Fields::kBottomFirst;
  Stand stand(options);
  film(stand, stand.bring_up(), 60);
  EXPECT_GE(counts(stand).seams_moved.load(), 1u);
  StandOptions jpeg = placed();
  jpeg.config.raymap.format = PixelFormat::kI420;
  for (firmware::HeadConfig& head : jpeg.config.heads) head.format = PixelFormat::kMjpeg;
  jpeg.world.head.pixels = PixelFormat::kMjpeg;
  Stand decoded(jpeg);
  film(decoded, decoded.bring_up(), 30);
  EXPECT_GE(counts(decoded).seams_moved.load(), 1u);
}

TEST(PlacedSeams, AHeadThatIsGone_IsShownNoMoreAndComesBack) {
  Stand stand(placed());
  TestHost& host = stand.bring_up();
  film(stand, host, 20);
  stand.world.head(1).unplug();
  const auto without = film(stand, host, 40);
  EXPECT_EQ(without.back().header.heads_mask() & 2U, 0U);
  const auto moved = counts(stand).seams_moved.load();
  EXPECT_GE(moved, 2u) << "its area goes to others";
  stand.world.head(1).replug();
  EXPECT_TRUE(stand.run_until([&] { return film(stand, host, 1).back().header.heads_mask() == (1U << kHeads) - 1; }));
  film(stand, host, 20);
  EXPECT_GT(counts(stand).seams_moved.load(), moved);
}

TEST(PlacedSeams, AnotherCalibration_HasItsOwn) {
  Stand stand(placed());
  TestHost& host = stand.bring_up();
  film(stand, host, 20);
  const auto moved = counts(stand).seams_moved.load();
  const wire::Reply reply = host.upload(to_json(small_calibration("other")));
  ASSERT_FALSE(reply.has_error()) << reply.error().message();
  film(stand, host, 20);
  EXPECT_GT(counts(stand).seams_moved.load(), moved);
}

}  // namespace
}  // namespace nodal::scenario
