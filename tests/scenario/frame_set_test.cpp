// Hosts request the heads' own pictures while the rig runs.
#include <gtest/gtest.h>

#include <numeric>
#include <set>

#include "firmware/hosts/frame_sender.h"
#include "firmware/hosts/stream_progress.h"
#include "protocol/upload.h"
#include "tests/scenario/stand.h"

namespace nodal::scenario {
namespace {

constexpr std::size_t kPictureBytes = std::size_t{3} * kHeadSide * kHeadSide;

wire::Reply ask_set(TestHost& host) {
  wire::Request request;
  request.mutable_frame_set();
  return host.ask(request);
}

/// The header and body of a stream's only item, in the form in which TestHost stores raymaps.
struct ReceivedSet {
  wire::FrameSetHeader header;
  std::vector<std::uint8_t> body;
};
ReceivedSet received(TestHost& host, StreamId stream) {
  ReceivedSet set;
  const auto& items = host.pulled[stream];
  if (items.size() == 1) {
    EXPECT_TRUE(set.header.ParseFromString(items.front().meta));
    set.body = items.front().body;
  }
  return set;
}

TEST(FrameSets, HostAsksWhileRaymapsRun_GetsEveryHeadsPictureOfOneSetAndNothingIsLost) {
  StandOptions options;
  options.world.scene = hal::sim::town_square_scene(3);
  Stand stand(options);
  TestHost& host = stand.bring_up();
  stand.lock(host);
  const StreamId raymaps = host.pull(false, 0);
  const wire::RigStatus before = host.status();
  const wire::Reply reply = ask_set(host);
  ASSERT_TRUE(reply.has_pull()) << reply.error().message();
  const StreamId stream = reply.pull().stream();
  ASSERT_TRUE(stand.run_until([&] { return host.closed.contains(stream); }));
  EXPECT_FALSE(host.closed[stream]) << host.closed[stream]->message;
  const ReceivedSet set = received(host, stream);
  ASSERT_EQ(set.header.heads_size(), kHeads);
  ASSERT_EQ(set.body.size(), kHeads * kPictureBytes);
  EXPECT_EQ(set.header.calibration_id(), sha256_to_wire(calibration_id(small_calibration())));
  EXPECT_EQ(set.header.genlock(), "locked");
  std::set<Sha256> seen;
  for (const wire::HeadPicture& head : set.header.heads()) {
    EXPECT_EQ(head.name(), "cam" + std::to_string(head.index()));
    EXPECT_EQ(head.format(), "RGB24");
    EXPECT_EQ(head.width(), static_cast<std::uint32_t>(kHeadSide));
    EXPECT_EQ(head.offset(), head.index() * kPictureBytes);
    EXPECT_GT(head.exposure_ns(), 0u);
    const std::span<const std::uint8_t> bytes(set.body.data() + head.offset(), kPictureBytes);
    EXPECT_GT(std::accumulate(bytes.begin(), bytes.end(), 0.0) / kPictureBytes, 10) << "black";
    EXPECT_TRUE(seen.insert(sha256(bytes)).second) << "two heads have one picture";
  }
  // Its raymap was blended nevertheless, and so were later ones.
  stand.run(Duration::milliseconds(500));
  const wire::RigStatus after = host.status();
  EXPECT_EQ(after.sets() - after.raymaps(), before.sets() - before.raymaps());
  EXPECT_EQ(host.dropped[raymaps], 0u);
}

TEST(FrameSets, NoCalibrationInForce_PicturesComeAllTheSame) {
  Stand stand;
  TestHost& host = stand.connect();
  stand.run(Duration::seconds(1));
  const wire::Reply reply = ask_set(host);
  ASSERT_TRUE(reply.has_pull()) << reply.error().message();
  ASSERT_TRUE(stand.run_until([&] { return host.closed.contains(reply.pull().stream()); }));
  const ReceivedSet set = received(host, reply.pull().stream());
  EXPECT_EQ(set.header.heads_size(), kHeads);
  EXPECT_TRUE(set.header.calibration_id().empty());
}

TEST(FrameSets, AHeadIsAway_TheOthersComeAndItIsNotAmongThem) {
  Stand stand;
  TestHost& host = stand.bring_up();
  stand.world.head(2).unplug();
  stand.run(Duration::seconds(1));
  const wire::Reply reply = ask_set(host);
  ASSERT_TRUE(reply.has_pull()) << reply.error().message();
  ASSERT_TRUE(stand.run_until([&] { return host.closed.contains(reply.pull().stream()); }));
  const ReceivedSet set = received(host, reply.pull().stream());
  ASSERT_EQ(set.header.heads_size(), kHeads - 1);
  for (const wire::HeadPicture& head : set.header.heads()) EXPECT_NE(head.name(), "cam2");
  EXPECT_EQ(set.body.size(), (kHeads - 1) * kPictureBytes) << "as many bytes as the listed heads have";
}

TEST(FrameSets, NoFramesCome_TheStreamEndsWithTheReasonAndTheNextOneWorksAgain) {
  Stand stand;
  TestHost& host = stand.bring_up();
  for (int i = 0; i < kHeads; ++i) stand.world.head(i).unplug();
  stand.run(Duration::seconds(1));
  const wire::Reply reply = ask_set(host);
  ASSERT_TRUE(reply.has_pull()) << reply.error().message();
  ASSERT_TRUE(stand.run_until([&] { return host.closed.contains(reply.pull().stream()); },
                              firmware::FrameSender::kPatience.least + Duration::seconds(1)));
  ASSERT_TRUE(host.closed[reply.pull().stream()]);
  EXPECT_EQ(host.closed[reply.pull().stream()]->code, Errc::kOverload);
  for (int i = 0; i < kHeads; ++i) stand.world.head(i).replug();
  stand.run(Duration::seconds(3));
  const wire::Reply again = ask_set(host);
  ASSERT_TRUE(again.has_pull()) << again.error().message();
  ASSERT_TRUE(stand.run_until([&] { return host.closed.contains(again.pull().stream()); }));
  EXPECT_EQ(received(host, again.pull().stream()).header.heads_size(), kHeads);
}

TEST(FrameSets, AHostThatDoesNotRead_HoldsUpNoRaymapAndNobodyForLong) {
  StandOptions options;
  Stand stand(options);
  TestHost& stuck = stand.bring_up();
  TestHost& other = stand.connect();
  stuck.link().in().capacity = 16U << 10;  // far less than the size of the set
  const wire::Reply reply = ask_set(stuck);
  ASSERT_TRUE(reply.has_pull());
  stuck.reading = false;
  stand.run(Duration::seconds(1));
  const wire::RigStatus before = other.status();
  stand.run(Duration::seconds(1));
  EXPECT_GE(other.status().raymaps(), before.raymaps() + 20);
  const wire::Reply beside = ask_set(other);
  ASSERT_TRUE(beside.has_pull()) << beside.error().message();
  ASSERT_TRUE(stand.run_until([&] { return other.closed.contains(beside.pull().stream()); }));
  EXPECT_EQ(received(other, beside.pull().stream()).header.heads_size(), kHeads);
  EXPECT_EQ(stand.rig->control().clients(), 2u);
  stand.run(firmware::StreamProgress::kLongestPause + Duration::seconds(2));
  EXPECT_EQ(stand.rig->control().clients(), 1u) << "its session would keep the copy";
}

TEST(FrameSets, AHostReadsAKilobyteASecond_GetsTheWholeSetWhileNobodyWaits) {
  Stand stand;
  TestHost& slow = stand.bring_up();
  constexpr Duration kSecond = Duration::seconds(1);
  slow.link().in().capacity = 1000;
  wire::Request request;
  request.mutable_frame_set();
  const std::uint64_t asked = slow.post(request);
  slow.pump();
  Duration taken;
  for (; slow.closed.empty() && !slow.dead() && taken < Duration::seconds(300); taken = taken + kSecond) {
    slow.reading = false;
    stand.run(kSecond);
    slow.reading = true;
    slow.pump();
  }
  ASSERT_FALSE(slow.dead()) << (slow.farewell() ? slow.farewell()->message : "disconnected");
  EXPECT_GT(taken, firmware::StreamProgress::kLongestPause) << "the link was not slow";
  ASSERT_TRUE(slow.reply(asked) && slow.reply(asked)->has_pull());
  EXPECT_EQ(received(slow, slow.reply(asked)->pull().stream()).header.heads_size(), kHeads);
}

}  // namespace
}  // namespace nodal::scenario
