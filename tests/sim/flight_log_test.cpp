// Flight records on the disk: after power cuts, in a second take, when they are lost.
#include <gtest/gtest.h>

#include <algorithm>
#include <string>

#include "firmware/flight/flight_recorder.h"
#include "flight_stand.h"
#include "hal/sim/rig.h"
#include "protocol/take/digest.h"
#include "protocol/take/documents.h"

namespace nodal::flight {
namespace {

TEST(FlightRecord, AfterAPowerCut_IsInTheManifestAndPlays) {
  Stand stand(flying_rig());
  TestHost& host = stand.bring_up();
  start_take(host);
  stand.run(Duration::milliseconds(3300));
  for (const std::uint64_t seed : {1, 2, 3, 4, 5, 6, 7, 8}) {
    SCOPED_TRACE(seed);
    Stand after(flying_rig(), nullptr, stand.takes->after_power_loss(seed));
    TestHost& visitor = after.connect();
    after.run(Duration::seconds(1));
    const wire::Reply list = ask(visitor, [](wire::Request& request) { request.mutable_take_list(); });
    ASSERT_EQ(list.takes().takes_size(), 1);
    ASSERT_EQ(list.takes().takes(0).state(), "complete");
    const auto text = after.takes->read("000001/manifest", 1 << 20);
    ASSERT_TRUE(text);
    const auto manifest = take::parse_manifest({reinterpret_cast<const char*>(text->data()), text->size()}, "manifest");
    ASSERT_TRUE(manifest);
    const auto listed = std::ranges::find(manifest->files, take::kFlightFile, &take::Manifest::File::name);
    ASSERT_NE(listed, manifest->files.end());
    const auto bytes = after.takes->read("000001/flight", 1 << 24);
    ASSERT_TRUE(bytes);
    EXPECT_EQ(listed->bytes, bytes->size());
    take::PieceHashes hashes;
    hashes.update(*bytes);
    EXPECT_EQ(listed->digest, take::digest_of(hashes.all()));
    const Played played = play(*bytes);
    ASSERT_TRUE(played.result) << played.result.error().text();
    EXPECT_FALSE(*played.result) << (*played.result)->text();
    EXPECT_GT(played.steps, 2500U) << "a step each ms; what is not older than 0.6 s may be missing";
  }
}

TEST(FlightRecord, OfTwoTakes_EachBeginsWithNodaldsStart) {
  Stand stand(flying_rig());
  TestHost& host = stand.bring_up();
  std::uint64_t steps = 0;
  for (const char* const take : {"000001", "000002"}) {
    start_take(host);
    stand.run(Duration::seconds(1));
    stop_take(host);
    const auto bytes = stand.takes->read(std::string(take) + "/flight", 1 << 24);
    ASSERT_TRUE(bytes);
    const Played played = play(*bytes);
    ASSERT_TRUE(played.result) << played.result.error().text();
    EXPECT_FALSE(*played.result) << (*played.result)->text();
    EXPECT_GT(played.steps, steps + 900);
    steps = played.steps;
  }
}

TEST(FlightLog, MoreThanItKeeps_TheTakeKeepsItsRecordAndLaterOnesHaveNone) {
  hal::sim::SimRig world(scenario::small_calibration(), {});
  firmware::FlightRecorder recorder(flying_config(), world.enumerator(), nullptr);
  firmware::FlightLog log(recorder, "a test", 8);
  ASSERT_TRUE(log.begin());
  Instant now;
  Bytes first_take;
  std::uint64_t steps = 0;
  const auto work = [&] {
    for (int k = 0; k < 20'000; ++k) {
      now = now + Duration::milliseconds(1);
      recorder.note(firmware::StepBegun{now});
      recorder.note(firmware::HeadFailed{0, {Errc::kDeviceGone, std::string(100, 'x')}});
      ++steps;
      if (k % 16 == 0) log.collect(now);
    }
    log.collect(now);
  };
  std::size_t most = 0;
  while (first_take.size() < firmware::FlightLog::kMax * 3 / 2) {
    work();
    for (auto record = log.next(); !record.empty(); record = log.next())
      first_take.insert(first_take.end(), record.begin(), record.end());
    ASSERT_LT(++most, 100U);
  }
  EXPECT_FALSE(log.overrun());
  log.close_record();
  for (auto record = log.next(); !record.empty(); record = log.next())
    first_take.insert(first_take.end(), record.begin(), record.end());
  const auto end = log.end();
  first_take.insert(first_take.end(), end.begin(), end.end());
  auto reader = FlightReader::open(first_take, "flight");
  ASSERT_TRUE(reader) << reader.error().text();
  std::uint64_t read = 0;
  for (auto step = reader->next_step(); step && !step->empty(); step = reader->next_step()) ++read;
  EXPECT_EQ(read, steps - 1) << "the last step may not be whole";
  EXPECT_EQ(reader->ended(), "the take ended");
  EXPECT_FALSE(log.begin());
  work();
  EXPECT_TRUE(log.next().empty());
  EXPECT_TRUE(log.end().empty());
}

TEST(FlightRecord, WhenTheDiskStallsForLong_EndsAndNoLaterTakeHasOne) {
  Stand stand(flying_rig());
  TestHost& host = stand.bring_up();
  start_take(host);
  stand.run(Duration::seconds(1));
  // The stage of the disk is not stepped, as if its disk stalled.
  for (std::size_t k = 0; k < 2 * firmware::FlightRecorder::kEvents; ++k) {
    stand.world.clock().advance(Duration::microseconds(500));
    stand.rig->step_capture();
  }
  stand.run(Duration::seconds(1));
  stop_take(host);
  const Played played = play(*stand.takes->read("000001/flight", 1 << 26));
  ASSERT_TRUE(played.result) << played.result.error().text();
  EXPECT_FALSE(*played.result) << (*played.result)->text();
  EXPECT_EQ(played.ended, "events were lost: they came faster than the disk stored them");
  start_take(host);
  stand.run(Duration::seconds(1));
  EXPECT_NE(host.status().recording().problem().find("no flight record"), std::string::npos)
      << host.status().recording().problem();
  stop_take(host);
  EXPECT_FALSE(stand.takes->size("000002/flight"));
}

}  // namespace
}  // namespace nodal::flight
