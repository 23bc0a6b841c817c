// Takes of a rig, as a host and a person with a button see them.
#include <gtest/gtest.h>

#include <memory>
#include <string>

#include "firmware/hosts/stream_progress.h"
#include "protocol/take/documents.h"
#include "protocol/take/evidence.h"
#include "tests/scenario/stand.h"

namespace nodal::scenario {
namespace {

using firmware::GenlockState;
using firmware::StreamProgress;

StandOptions recording_rig() {
  StandOptions options;
  options.config.takes = firmware::TakesConfig{.folder = "takes", .buffer_mb = 16};
  return options;
}

class TakeScenario : public testing::Test {
 protected:
  Stand stand{recording_rig()};
  TestHost& host{stand.bring_up()};

  wire::Reply ask(const std::function<void(wire::Request&)>& fill) {
    wire::Request request;
    fill(request);
    return host.ask(request);
  }
  wire::Reply start() {
    return ask([](wire::Request& request) { request.mutable_take_start(); });
  }
  wire::Reply stop() {
    return ask([](wire::Request& request) { request.mutable_take_stop(); });
  }
  wire::Reply still() {
    return ask([](wire::Request& request) { request.mutable_take_start()->set_still(true); });
  }
  /// Records a take; returns its number.
  std::uint64_t record(Duration length = Duration::seconds(1)) {
    EXPECT_TRUE(start().has_take());
    stand.run(length);
    const wire::Reply stopped = stop();
    EXPECT_TRUE(stopped.has_take()) << stopped.error().message();
    return stopped.take().take();
  }
  wire::Takes list() {
    return ask([](wire::Request& request) { request.mutable_take_list(); }).takes();
  }
  static wire::Request read(std::uint64_t take, const std::string& file, std::uint64_t offset = 0) {
    wire::Request request;
    request.mutable_take_read()->set_take(take);
    request.mutable_take_read()->set_file(file);
    request.mutable_take_read()->set_offset(offset);
    return request;
  }
  std::vector<std::uint8_t> on_disk(std::uint64_t take, const std::string& file) {
    return stand.takes->read(take::take_folder(take) + "/" + file, 1 << 28).value_or(std::vector<std::uint8_t>());
  }
  take::Manifest manifest(std::uint64_t take) {
    const auto bytes = on_disk(take, take::kManifestFile);
    const auto parsed = take::parse_manifest({reinterpret_cast<const char*>(bytes.data()), bytes.size()}, "manifest");
    EXPECT_TRUE(parsed) << parsed.error().text();
    return parsed.value_or(take::Manifest());
  }
  void press(Duration length) {
    const Instant now = stand.world.clock().now();
    stand.button.script(now, true);
    stand.button.script(now + length, false);
    stand.run(length + Duration::milliseconds(300));
  }
};

TEST_F(TakeScenario, AStill_IsATakeOfOneSetWithAllHeadsAndItsRaymap) {
  const wire::Reply reply = still();
  ASSERT_TRUE(reply.has_take()) << reply.error().message();
  const take::Manifest made = manifest(reply.take().take());
  EXPECT_EQ(made.sets, 1U);
  EXPECT_EQ(made.ended, "still");
  const auto evidence = take::read_evidence(on_disk(reply.take().take(), "evidence-0000"), "evidence-0000");
  ASSERT_TRUE(evidence) << evidence.error().text();
  ASSERT_EQ(evidence->sets.size(), 1U);
  for (const auto& frame : evidence->sets[0].frames()) EXPECT_EQ(frame.placeholder(), "");
  ASSERT_EQ(evidence->raymaps.size(), 1U);
  EXPECT_EQ(evidence->raymaps[0].set(), evidence->sets[0].number());
  EXPECT_TRUE(still().has_take()) << "and another";
}

TEST_F(TakeScenario, AStillOfHeadsThatDeliverNothing_IsRefusedAndLeavesNoTake) {
  for (int head = 0; head < kHeads; ++head) stand.world.head(head).unplug();
  stand.run(Duration::seconds(1));
  const Instant before = stand.world.clock().now();
  const wire::Reply reply = still();
  ASSERT_TRUE(reply.has_error());
  EXPECT_NE(reply.error().message().find("no set came"), std::string::npos) << reply.error().message();
  EXPECT_LT(stand.world.clock().now() - before, Duration::seconds(8));
  EXPECT_EQ(list().takes_size(), 0);
}

TEST_F(TakeScenario, TheButton_StartsGenlockAndTakeMarksAndEnds) {
  press(Duration::milliseconds(150));
  ASSERT_TRUE(stand.run_until([&] { return stand.capture().genlock.state == GenlockState::kLocked; }));
  EXPECT_EQ(host.status().recording().take(), 1U);
  EXPECT_TRUE(stand.tally_lamp.level_at(stand.world.clock().now()));
  press(Duration::milliseconds(150));
  press(Duration::seconds(2));
  ASSERT_TRUE(stand.run_until([&] { return !host.status().recording().has_take(); }));
  EXPECT_FALSE(stand.tally_lamp.level_at(stand.world.clock().now()));
  EXPECT_NE(stand.capture().genlock.state, GenlockState::kOff) << "the button ends the take, not the genlock";
  const take::Manifest made = manifest(1);
  EXPECT_EQ(made.ended, "stopped");
  ASSERT_EQ(made.marks.size(), 1U);
  EXPECT_EQ(made.marks[0].text, "button");
  EXPECT_GT(made.marks[0].set, 0U);
  EXPECT_LE(made.marks[0].set, made.sets);
  press(Duration::milliseconds(150));
  EXPECT_EQ(host.status().recording().take(), 2U);
}

TEST_F(TakeScenario, Delete_NeedsTheManifestThatTheHostNames) {
  const std::uint64_t take = record();
  const auto bytes = on_disk(take, take::kManifestFile);
  Sha256 id = sha256(bytes);
  id[7] ^= 1;
  const auto remove = [&] {
    return ask([&](wire::Request& request) {
      request.mutable_take_delete()->set_take(take);
      request.mutable_take_delete()->set_manifest_sha256(sha256_to_wire(id));
    });
  };
  const wire::Reply refused = remove();
  ASSERT_TRUE(refused.has_error());
  EXPECT_NE(refused.error().message().find("another manifest"), std::string::npos) << refused.error().message();
  EXPECT_EQ(list().takes_size(), 1);
  id[7] ^= 1;
  EXPECT_TRUE(remove().has_take());
  EXPECT_EQ(list().takes_size(), 0);
}

TEST_F(TakeScenario, AFile_ComesInPiecesWithItsLength) {
  const std::uint64_t take = record();
  for (const take::Manifest::File& file : manifest(take).files) {
    SCOPED_TRACE(file.name);
    const wire::Reply reply = host.ask(read(take, file.name));
    ASSERT_TRUE(reply.has_pull()) << reply.error().message();
    const StreamId stream = reply.pull().stream();
    ASSERT_TRUE(stand.run_until([&] { return host.closed.contains(stream); }));
    EXPECT_FALSE(host.closed.at(stream).has_value());
    std::vector<std::uint8_t> got;
    for (const Pulled& piece : host.pulled[stream]) {
      wire::TakePiece meta;
      ASSERT_TRUE(meta.ParseFromString(piece.meta));
      EXPECT_EQ(meta.offset(), got.size());
      EXPECT_EQ(meta.file_bytes(), file.bytes);
      got.insert(got.end(), piece.body.begin(), piece.body.end());
    }
    EXPECT_EQ(got, on_disk(take, file.name));
  }
}

TEST_F(TakeScenario, StrangeRequestsForFiles_AreAnsweredWithTheirReason) {
  const std::uint64_t take = record();
  EXPECT_TRUE(host.ask(read(take, "cam0-0000.mkv", 5)).has_error()) << "no multiple of 1 MiB";
  struct Case {
    std::uint64_t take;
    std::string file;
    std::uint64_t offset;
    const char* reason;
  };
  for (const Case& each : {Case{take, "../next-take", 0, "is no file of a take"},
                           Case{take, std::string(5000, 'x'), 0, "is no file of a take"},
                           Case{take, "", 0, "is no file of a take"}, Case{take, "cam9-0000.mkv", 0, "cam9-0000.mkv"},
                           Case{take, "cam0-0000.mkv", std::uint64_t{1} << 40, "nothing can be read"},
                           Case{take, "cam0-0000.mkv", ~std::uint64_t{0} << 20, "nothing can be read"},
                           Case{~std::uint64_t{0}, "cam0-0000.mkv", 0, "there is no take"}}) {
    SCOPED_TRACE(each.file.substr(0, 20));
    const wire::Reply reply = host.ask(read(each.take, each.file, each.offset));
    ASSERT_TRUE(reply.has_pull()) << reply.error().message();
    ASSERT_TRUE(stand.run_until([&] { return host.closed.contains(reply.pull().stream()); }));
    const auto& error = host.closed.at(reply.pull().stream());
    ASSERT_TRUE(error);
    EXPECT_NE(error->message.find(each.reason), std::string::npos) << error->message;
  }
  EXPECT_FALSE(host.dead());
}

TEST_F(TakeScenario, AHostThatReadsNothing_HoldsUpNobodyAndIsCutOff) {
  const std::uint64_t take = record(Duration::seconds(3));  // its files are longer than the link's buffer
  TestHost& stuck = stand.connect();
  stand.run(Duration::milliseconds(10));
  stuck.reading = false;
  stuck.post(read(take, "cam0-0000.mkv"));
  stand.run(Duration::seconds(1));
  const wire::Reply reply = host.ask(read(take, "cam1-0000.mkv"));
  ASSERT_TRUE(reply.has_pull()) << reply.error().message();
  ASSERT_TRUE(stand.run_until([&] { return host.closed.contains(reply.pull().stream()); }, Duration::seconds(1)));
  stand.run(StreamProgress::kLongestPause + Duration::seconds(1));
  stuck.reading = true;
  stand.run(Duration::milliseconds(100));
  ASSERT_EQ(stuck.closed.size(), 1u);
  ASSERT_TRUE(stuck.closed.begin()->second);
  EXPECT_EQ(stuck.closed.begin()->second->code, Errc::kTimeout);
}

}  // namespace
}  // namespace nodal::scenario
