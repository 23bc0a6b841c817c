// Whole rigs with placed seams.
#include <gtest/gtest.h>

#include <algorithm>

#include "protocol/base/field.h"
#include "stitch/sets/plan_job.h"
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

const firmware::MovingSeams::Counts& counts(Stand& stand) { return stand.rig->blender().seams().counts(); }

TEST(PlacedSeams, ARig_PlacesThemAndMakesTheSameRaymapsOnEveryRun) {
  Stand first(placed()), second(placed());
  StandOptions as_fixed = placed();
  as_fixed.config.raymap.seams = SeamPlacement::kFixed;
  Stand fixed(as_fixed);
  TestHost& host = first.bring_up();
  const auto raymaps = film(first, host, 40);
  const wire::RigStatus status = host.status();
  EXPECT_EQ(status.seams().placed(), counts(first).moved.load());
  EXPECT_EQ(status.seams().late() + status.seams().refused(), 0U);
  expect_same(raymaps, film(second, second.bring_up(), 40));
  EXPECT_GE(counts(first).moved.load(), 1u);
  EXPECT_EQ(counts(first).late.load(), 0u);
  TestHost& host_of_fixed = fixed.bring_up();
  EXPECT_FALSE(host_of_fixed.status().has_seams());
  const auto unmoved = film(fixed, host_of_fixed, 40);
  EXPECT_NE(raymaps.back().body, unmoved.back().body);
  EXPECT_EQ(counts(fixed).moved.load(), 0u);
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
  EXPECT_GE(counts(stand).moved.load(), 1u);
  StandOptions jpeg = placed();
  jpeg.config.raymap.format = PixelFormat::kI420;
  for (firmware::HeadConfig& head : jpeg.config.heads) head.format = PixelFormat::kMjpeg;
  jpeg.world.head.pixels = PixelFormat::kMjpeg;
  Stand decoded(jpeg);
  film(decoded, decoded.bring_up(), 30);
  EXPECT_GE(counts(decoded).moved.load(), 1u);
}

TEST(PlacedSeams, AHeadThatIsGone_IsShownNoMoreAndComesBack) {
  Stand stand(placed());
  TestHost& host = stand.bring_up();
  film(stand, host, 20);
  stand.world.head(1).unplug();
  const auto without = film(stand, host, 40);
  EXPECT_EQ(without.back().header.heads_mask() & 2U, 0U);
  const auto moved = counts(stand).moved.load();
  EXPECT_GE(moved, 2u) << "its area goes to others";
  stand.world.head(1).replug();
  EXPECT_TRUE(stand.run_until([&] { return film(stand, host, 1).back().header.heads_mask() == (1U << kHeads) - 1; }));
  film(stand, host, 20);
  EXPECT_GT(counts(stand).moved.load(), moved);
}

TEST(PlacedSeams, AnotherCalibration_HasItsOwn) {
  Stand stand(placed());
  TestHost& host = stand.bring_up();
  film(stand, host, 20);
  const auto moved = counts(stand).moved.load();
  const wire::Reply reply = host.upload(to_json(small_calibration("other")));
  ASSERT_FALSE(reply.has_error()) << reply.error().message();
  film(stand, host, 20);
  EXPECT_GT(counts(stand).moved.load(), moved);
}

/// As if the compiler of tables had a fault: a head's patches are far outside of its picture.
sets::BlendSetup broken_calibration(const StandOptions& options) {
  std::vector<PixelFormat> formats;
  for (const firmware::HeadConfig& head : options.config.heads) formats.push_back(head.format);
  auto job = sets::PlanJob::make(options.truth, options.config.raymap, Fields::kProgressive, formats).value();
  while (!job.tables().done()) job.tables().compile_some(64);
  sets::BlendPlan broken = *std::move(job).finish({}).value();
  blend::GridTable& cover = broken.tables[0].cover[0];
  std::ranges::fill(cover.coordinates, std::int16_t{20'000});
  for (blend::PatchRecord& record : cover.records) {
    if (!record.listed()) record.x[0] = 20'000;
  }
  return sets::with_memory(std::make_shared<const sets::BlendPlan>(std::move(broken)));
}

TEST(PlacedSeams, ThatAreRefused_AreCountedAndSaidOnceAndTheRigFilmsOn) {
  Stand stand(placed());
  TestHost& host = stand.bring_up();
  stand.rig->control().take_news();
  ASSERT_TRUE(stand.rig->blender().swap().tables_in().push(broken_calibration(stand.options)));
  EXPECT_EQ(film(stand, host, 60).size(), 60U);
  EXPECT_GE(host.status().seams().refused(), 3U);
  EXPECT_EQ(host.status().state(), "running");
  const std::vector<std::string> news = stand.rig->control().take_news();
  const auto says = [](const std::string& line) {
    return line.find("placed seams were refused, and the old ones stay") != std::string::npos &&
           line.find("blend table: ") != std::string::npos;
  };
  EXPECT_EQ(std::ranges::count_if(news, says), 1);
}

/// When the blend has begun a set, it has logged the set's seams. A blend that hangs stops no recording.
TEST(PlacedSeams, ATakeWaitsForTheBlendThatLogsThem_ButNotForOneThatHangs) {
  StandOptions options = placed();
  options.config.takes = firmware::TakesConfig{.folder = "takes", .buffer_mb = 64};
  Stand stand(options);
  TestHost& host = stand.bring_up();
  wire::Request start;
  start.mutable_take_start();
  ASSERT_TRUE(host.ask(start).has_take());
  stand.run(Duration::seconds(1));
  const auto written = [&] { return stand.rig->takes().snapshot().read().sets; };
  const auto run_without_blend = [&](Duration length) {
    for (const Instant end = stand.world.clock().now() + length; stand.world.clock().now() < end;) {
      stand.world.clock().advance(Duration::milliseconds(1));
      while (stand.rig->step_capture() || stand.rig->step_record() || stand.rig->step_takes()) {}
    }
  };
  const std::uint64_t before = written(), recorded = stand.rig->recorder().counts().sets.load();
  EXPECT_GT(before, 15U);
  run_without_blend(Duration::milliseconds(900));
  EXPECT_GT(stand.rig->recorder().counts().sets.load(), recorded + 20);
  EXPECT_LE(written(), before + 8) << "rows whose sets the blend has begun";
  run_without_blend(Duration::milliseconds(700));
  EXPECT_GT(written(), before + 20);
  stand.run(Duration::seconds(1));
  wire::Request stop;
  stop.mutable_take_stop();
  EXPECT_TRUE(host.ask(stop).has_take());
  EXPECT_EQ(stand.rig->recorder().counts().lost_sets.load(), 0U);
}

}  // namespace
}  // namespace nodal::scenario
