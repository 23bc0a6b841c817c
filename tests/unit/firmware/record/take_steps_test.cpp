// Takes with manifests so large that one look at the disk does not read them all.
#include <gtest/gtest.h>

#include <algorithm>
#include <string>
#include <vector>

#include "firmware/flight/flight_recorder.h"
#include "firmware/record/recording.h"
#include "firmware/record/take_shelf.h"
#include "hal/sim/clock.h"
#include "hal/sim/disk.h"
#include "protocol/take/documents.h"
#include "protocol/take/evidence.h"
#include "tests/support/take_stage.h"

namespace nodal::firmware {
namespace {

/// A disk with one finished take, 1.
struct LargeTakes {
  LargeTakes() {
    TakeStage stage(disk, clock, {});
    EXPECT_TRUE(stage.start().result);
    stage.run(Duration::seconds(1));
    EXPECT_TRUE(stage.ask(TakeRequest::Stop{}).result);
    stage.close();
  }
  void copy(std::uint64_t from, std::uint64_t to) {
    const std::string source = take::take_folder(from), folder = take::take_folder(to);
    ASSERT_TRUE(disk.make_folder(folder));
    const std::vector<std::string> names = disk.list(source).value();
    for (const std::string& name : names)
      disk.put(folder + "/" + name, disk.read(source + "/" + name, 1 << 26).value());
  }
  /// A copy of take 1 whose manifest has so many bytes, most of them spaces.
  void bring_large(std::uint64_t number, std::uint64_t bytes) {
    copy(1, number);
    const std::string name = take::take_folder(number) + "/" + take::kManifestFile;
    auto manifest = disk.read(name, bytes).value();
    manifest.resize(bytes, ' ');
    disk.put(name, manifest);
  }

  hal::sim::SimClock clock;
  hal::sim::SimDisk disk;
};

std::size_t count_unread(const std::vector<TakeEntry>& takes) {
  return static_cast<std::size_t>(std::ranges::count_if(
      takes, [](const TakeEntry& take) { return take.problem.find("has not been read yet") != std::string::npos; }));
}

TEST(TakeSteps, ManifestsOfMoreThanAStepReads_AreReadInLaterSteps) {
  LargeTakes world;
  for (std::uint64_t number = 2; number <= 5; ++number) world.bring_large(number, 20 << 20);
  world.disk.put("000005/" + std::string(take::kProtectedFile), {});
  TakeStage stage(world.disk, world.clock, {});
  const std::vector<TakeEntry> first = stage.list();
  ASSERT_EQ(first.size(), 5U);
  EXPECT_GE(count_unread(first), 2U);
  EXPECT_TRUE(first[4].is_protected) << "nothing deletes it before it is read";
  stage.run(Duration::seconds(5));
  for (const TakeEntry& take : stage.list()) {
    EXPECT_EQ(take.state, TakeState::kComplete) << take.number << ": " << take.problem;
    EXPECT_EQ(take.sets, first[0].sets);
  }
}

TEST(TakeSteps, AnUnfinishedTakeBehindLargeManifests_IsRecoveredWhenItIsRead) {
  LargeTakes world;
  {
    TakeStage killed(world.disk, world.clock, {});
    ASSERT_TRUE(killed.start().result);
    killed.run(Duration::seconds(2));
    world.disk.release();
  }
  world.copy(2, 9);
  const std::vector<std::string> names = world.disk.list("000002").value();
  for (const std::string& name : names) ASSERT_TRUE(world.disk.remove("000002/" + name));
  ASSERT_TRUE(world.disk.remove("000002"));
  // With take 1 and take.json, one of them fills a step to the byte.
  const auto size = [&](const std::string& name) { return world.disk.size("000001/" + name).value(); };
  const std::uint64_t fills = TakeShelf::kMaxBytesAStep - 2 * size(take::kTakeFile) - size(take::kManifestFile);
  for (const std::uint64_t number : {2, 3, 4}) world.bring_large(number, fills);
  TakeStage next(world.disk, world.clock, {});
  EXPECT_EQ(count_unread(next.list()), 1U) << "4; take 9 waited for this second look";
  next.run(Duration::seconds(10));
  const std::vector<TakeEntry> takes = next.list();
  ASSERT_EQ(takes.size(), 5U);
  EXPECT_EQ(takes[4].state, TakeState::kComplete) << takes[4].problem;
  EXPECT_EQ(takes[4].ended, "recovered");
}

/// No head delivers anything.
class NoHeads : public hal::HeadEnumerator {
 public:
  Result<std::unique_ptr<hal::HeadPort>> open(const std::string&) override { return fail(Errc::kDeviceGone, "none"); }
  std::vector<hal::HeadIdentity> list() override { return {}; }
};

TEST(TakeSteps, ATakeEndsWithALongFlightRecord_EachStepWritesALittleOfIt) {
  hal::sim::SimClock clock;
  hal::sim::SimDisk disk;
  NoHeads none;
  RigConfig config;
  FlightRecorder recorder(config, none, nullptr);
  FlightLog log(recorder, "a test", 8);
  const std::string file = take::take_folder(1) + "/" + take::kFlightFile;
  std::uint64_t bytes = 0, most = 0;
  TakeStage::Options options;
  options.flight = &log;
  options.stepped = [&] {
    const std::uint64_t now = disk.size(file).value_or(0);
    most = std::max(most, now - std::exchange(bytes, now));
  };
  TakeStage stage(disk, clock, options);
  for (int k = 0; k < 200'000; ++k) {
    recorder.note(StepBegun{clock.now()});
    recorder.note(HeadFailed{0, {Errc::kDeviceGone, std::string(60, 'x')}});
    if (k % 8192 == 0) log.collect(clock.now());
  }
  log.collect(clock.now());
  ASSERT_FALSE(log.overrun());
  stage.request(stage.start_request());
  stage.request(TakeRequest::Stop{});
  EXPECT_TRUE(stage.next_answer().result);
  EXPECT_TRUE(stage.next_answer().result);
  EXPECT_GT(bytes, std::uint64_t{10} << 20) << "all of it is in the take";
  EXPECT_LE(most, 2 * Recording::kFlightRecordsAStep * FlightLog::kRecordBytes);
  EXPECT_EQ(stage.list().at(0).state, TakeState::kComplete);
}

}  // namespace
}  // namespace nodal::firmware
