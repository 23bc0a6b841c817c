// Hosts: several at once, slow, stuck, hostile, disconnected during a transfer.
#include <gtest/gtest.h>

#include <algorithm>

#include "tests/scenario/stand.h"

namespace nodal::scenario {
namespace {

wire::Request commit_of(const std::string& document) {
  const auto bytes = std::make_shared<const std::vector<std::uint8_t>>(document.begin(), document.end());
  wire::Request request;
  *request.mutable_upload_commit() = UploadSender(bytes).commit();
  return request;
}

Sha256 in_force(Stand& stand) { return stand.rig->keeper().report().in_force.value_or(Sha256{}); }

TEST(Hosts, TwoPullAtOnce_BothGetEveryRaymap) {
  Stand stand;
  TestHost& first = stand.bring_up();
  TestHost& second = stand.connect();
  const StreamId a = first.pull(true, 0);
  const StreamId b = second.pull(false, 0);
  stand.run(Duration::seconds(2));
  EXPECT_NEAR(static_cast<double>(first.pulled[a].size()), 60, 2);
  EXPECT_NEAR(static_cast<double>(second.pulled[b].size()), 60, 2);
  EXPECT_EQ(first.dropped[a], 0u);
  EXPECT_EQ(second.dropped[b], 0u);
}

TEST(Hosts, OneIsSlow_ItAloneMissesRaymapsAndIsToldHowMany) {
  Stand stand;
  TestHost& slow = stand.bring_up();
  TestHost& fast = stand.connect();
  const StreamId a = slow.pull(false, 0);
  const StreamId b = fast.pull(false, 0);
  stand.run(Duration::milliseconds(200));
  slow.reading = false;
  const std::size_t had = fast.pulled[b].size();
  stand.run(Duration::seconds(30));
  EXPECT_GE(fast.pulled[b].size() - had, 895u);
  EXPECT_EQ(fast.dropped[b], 0u);
  const wire::RigStatus status = fast.status();
  ASSERT_EQ(status.publish_drops_size(), 1);
  EXPECT_NE(status.publish_drops(0).reason().find("host 1"), std::string::npos);
  EXPECT_GT(status.publish_drops(0).frames(), 800u);
  slow.reading = true;
  stand.run(Duration::seconds(1));
  EXPECT_GT(slow.dropped[a], 800u);
  const std::vector<Pulled>& got = slow.pulled[a];
  EXPECT_TRUE(std::is_sorted(got.begin(), got.end(),
                             [](const Pulled& x, const Pulled& y) { return x.header.set() < y.header.set(); }));
}

TEST(Hosts, ALosslessPullThatPausesThreeQuartersOfEverySecond_MissesNoSet) {
  Stand stand;
  TestHost& host = stand.bring_up();
  const StreamId stream = host.pull(false, 60, true);
  host.link().in().capacity = 1000;  // pending bytes stay on the rig
  for (int i = 0; i < 20 && !host.closed.contains(stream); ++i) {
    host.reading = i % 4 == 0;
    stand.run(Duration::milliseconds(250));
  }
  ASSERT_TRUE(host.closed.contains(stream));
  EXPECT_FALSE(host.closed[stream]) << host.closed[stream]->message;
  const std::vector<Pulled>& got = host.pulled[stream];
  ASSERT_EQ(got.size(), 60u);
  EXPECT_EQ(got.back().header.set(), got.front().header.set() + 59);
  EXPECT_EQ(host.dropped[stream], 0u);
  EXPECT_EQ(stand.rig->control().sets_missed_by_blend(), 0u);
}

TEST(Hosts, ALosslessPullThatIsStuck_IsEndedAndTheRigGoesOn) {
  Stand stand;
  TestHost& stuck = stand.bring_up();
  TestHost& other = stand.connect();
  const StreamId stream = stuck.pull(false, 0, true);
  const StreamId live = other.pull(false, 0);
  stand.run(Duration::milliseconds(300));
  stuck.reading = false;
  stand.run(Duration::seconds(15));
  EXPECT_EQ(stand.rig->control().sets_missed_by_blend(), 0u);
  const std::size_t had = other.pulled[live].size();
  stand.run(Duration::seconds(2));
  EXPECT_GE(other.pulled[live].size(), had + 55);
  stuck.reading = true;
  stand.run(Duration::milliseconds(500));
  ASSERT_TRUE(stuck.closed.contains(stream));
  EXPECT_EQ(stuck.closed[stream]->code, Errc::kTimeout);
}

TEST(Hosts, APullIsStopped_NothingMoreComesAndItsStreamCloses) {
  Stand stand;
  TestHost& host = stand.bring_up();
  const StreamId stream = host.pull(true, 0);
  stand.run(Duration::milliseconds(500));
  wire::Request stop;
  stop.mutable_pull_stop()->set_stream(stream);
  EXPECT_TRUE(host.ask(stop).has_done());
  stand.run(Duration::milliseconds(100));
  EXPECT_TRUE(host.closed.contains(stream));
  const std::size_t had = host.pulled[stream].size();
  stand.run(Duration::milliseconds(500));
  EXPECT_EQ(host.pulled[stream].size(), had);
  EXPECT_EQ(host.ask(stop).error().code(), static_cast<unsigned>(Errc::kNotFound));
}

TEST(Hosts, AHostRefusesTheStreamOfItsPull_NothingMoreComesAndItMayPullAgain) {
  Stand stand;
  TestHost& host = stand.bring_up();
  const StreamId refused = host.pull(true, 0);
  stand.run(Duration::milliseconds(500));
  host.session().stop_stream(refused, {Errc::kOverload, "this host's disk is full"});
  stand.run(Duration::milliseconds(100));
  const std::size_t had = host.pulled[refused].size();
  const StreamId next = host.pull(true, 0);
  stand.run(Duration::milliseconds(500));
  EXPECT_EQ(host.pulled[refused].size(), had);
  EXPECT_GT(host.pulled[next].size(), 10u);
  wire::Request stop;
  stop.mutable_pull_stop()->set_stream(refused);
  EXPECT_EQ(host.ask(stop).error().code(), static_cast<unsigned>(Errc::kNotFound)) << "it has ended already";
}

TEST(Hosts, MorePullsThanAHostMayHave_AreRefused) {
  Stand stand;
  TestHost& host = stand.bring_up();
  for (std::size_t i = 0; i < firmware::Publisher::kMaxPulls; ++i) EXPECT_NE(host.pull(false, 0), 0u);
  EXPECT_EQ(host.pull(false, 0), 0u);
  EXPECT_EQ(host.refusal.code(), static_cast<unsigned>(Errc::kOverload));
}

TEST(Hosts, OneSpeaksRubbish_ItAloneIsDropped) {
  Stand stand;
  TestHost& good = stand.bring_up();
  TestHost& bad = stand.connect();
  const StreamId stream = good.pull(false, 0);
  stand.run(Duration::milliseconds(100));
  const std::vector<std::uint8_t> rubbish(5000, 0xa5);
  ASSERT_TRUE(bad.link().write(rubbish));
  stand.run(Duration::seconds(1));
  EXPECT_TRUE(bad.dead());
  ASSERT_NE(bad.farewell(), nullptr);
  EXPECT_EQ(bad.farewell()->code, Errc::kProtocol) << bad.farewell()->text();
  EXPECT_EQ(stand.rig->control().clients(), 1u);
  EXPECT_NEAR(static_cast<double>(good.pulled[stream].size()), 33, 2);
}

TEST(Hosts, ARequestNobodyKnows_IsAnsweredSo) {
  Stand stand;
  EXPECT_EQ(stand.connect().ask({}).error().code(), static_cast<unsigned>(Errc::kUnsupported));
}

TEST(Hosts, ManyRequestsAtOnce_AreAllAnswered) {
  Stand stand;
  TestHost& host = stand.bring_up();
  std::vector<std::uint64_t> ids;
  for (int i = 0; i < 200; ++i) {
    wire::Request request;
    i % 2 == 0 ? (void)request.mutable_calibration_list() : (void)request.mutable_head_set()->set_gain_mdb(i);
    ids.push_back(host.post(request));
  }
  stand.run(Duration::seconds(1));
  for (const std::uint64_t id : ids) {
    ASSERT_NE(host.reply(id), nullptr) << id;
    EXPECT_FALSE(host.reply(id)->has_error()) << host.reply(id)->error().message();
  }
}

TEST(Upload, TheLinkBreaksAnywhere_TheNextHostGoesOnFromThere) {
  const Calibration big = small_calibration("second");
  const std::string document = to_json(big) + std::string(200'000, ' ');  // several pieces of a bulk stream
  std::uint64_t furthest = 0;
  for (std::uint64_t cut = 40; cut < document.size(); cut += 29'989) {
    Stand stand;
    stand.bring_up();
    TestHost& first = stand.connect();
    stand.run(Duration::milliseconds(20));
    first.send_document(document);
    hal::sim::LinkPipe& wire = first.link().out();
    wire.capacity = 1000;  // the link's capacity per step
    const std::uint64_t from = wire.written;
    for (int i = 0; i < 1000 && wire.written < from + cut; ++i) {
      first.pump();
      stand.rig->step_control();
    }
    first.link().reset();
    stand.run(Duration::milliseconds(20));
    EXPECT_TRUE(first.dead());
    EXPECT_NE(in_force(stand), calibration_id(big));

    TestHost& second = stand.connect();
    const std::uint64_t offset = second.send_document(document);
    EXPECT_LE(offset, cut);
    EXPECT_GE(offset + 2 * kMaxPieceBytes, cut) << "whole pieces that came are kept";
    furthest = std::max(furthest, offset);
    const wire::Reply done = second.upload(document);
    ASSERT_TRUE(done.has_done()) << done.error().message();
    EXPECT_EQ(in_force(stand), calibration_id(big));
  }
  EXPECT_GT(furthest, document.size() / 2);
}

TEST(Upload, TheHostGoesAwayAfterItsCommit_TheCalibrationComesIntoForceAllTheSame) {
  Stand stand;
  TestHost& host = stand.bring_up();
  const std::string document = to_json(small_calibration("second"));
  host.send_document(document);
  stand.run(Duration::milliseconds(50));
  host.post(commit_of(document));
  host.pump();
  stand.settle();
  stand.hosts.clear();
  stand.run(Duration::seconds(1));
  EXPECT_EQ(in_force(stand), calibration_id(small_calibration("second")));
}

TEST(Upload, ACommitBeforeItsBytes_IsRefusedWithHowManyAreThere) {
  Stand stand;
  TestHost& host = stand.bring_up();
  const std::string document = to_json(small_calibration("second"));
  const auto bytes = std::make_shared<const std::vector<std::uint8_t>>(document.begin(), document.end());
  wire::Request begin;
  *begin.mutable_upload_begin() = UploadSender(bytes).begin();
  ASSERT_TRUE(host.ask(begin).has_upload());
  EXPECT_EQ(host.ask(commit_of(document)).error().code(), static_cast<unsigned>(Errc::kTruncated));
}

TEST(Upload, ACommitThatIsNotAllowed_LeavesTheDocumentForAnother) {
  Stand stand;
  TestHost& host = stand.bring_up();
  const std::string document = to_json(small_calibration("second"));
  host.send_document(document);
  stand.run(Duration::seconds(1));
  wire::Request commit = commit_of(document);
  commit.mutable_upload_commit()->set_trial_ns(999'999'999);
  EXPECT_EQ(host.ask(commit).error().code(), static_cast<unsigned>(Errc::kBadValue));
  commit.mutable_upload_commit()->clear_trial_ns();
  commit.mutable_upload_commit()->set_signature(std::string(4097, 's'));
  EXPECT_EQ(host.ask(commit).error().code(), static_cast<unsigned>(Errc::kTooLarge));
  const wire::Reply done = host.ask(commit_of(document));
  EXPECT_TRUE(done.has_done()) << done.error().message();
  EXPECT_EQ(in_force(stand), calibration_id(small_calibration("second")));
}

TEST(Upload, WhatIsNoCalibrationForThisRig_IsRefusedByNameAndTheOldOneStays) {
  Stand stand;
  TestHost& host = stand.bring_up();
  const Sha256 old = in_force(stand);
  const auto expect_refused = [&](const Calibration& calibration, Errc code, const std::string& part) {
    const wire::Reply reply = host.upload(to_json(calibration));
    EXPECT_EQ(reply.error().code(), static_cast<unsigned>(code)) << reply.error().message();
    EXPECT_NE(reply.error().message().find(part), std::string::npos) << reply.error().message();
    EXPECT_EQ(in_force(stand), old);
  };
  Calibration wrong = small_calibration();
  wrong.heads.pop_back();
  expect_refused(wrong, Errc::kHeadMismatch, "'cam5'");
  wrong = small_calibration();
  wrong.heads[1].name = "camX";
  expect_refused(wrong, Errc::kHeadMismatch, "'cam1'");
  wrong = small_calibration();
  wrong.heads.push_back(wrong.heads[0]);
  wrong.heads.back().name = "cam6";
  expect_refused(wrong, Errc::kHeadMismatch, "'cam6'");
  wrong = small_calibration();
  wrong.heads[2].width = 80;
  wrong.heads[2].region.right = 80;
  expect_refused(wrong, Errc::kHeadMismatch, "head 'cam2' delivers 64x64, but its calibration is for 80x64");
  const wire::Reply rubbish = host.upload("{\"nodal_calibration\": 1");
  EXPECT_TRUE(rubbish.has_error());
  EXPECT_EQ(in_force(stand), old);
  EXPECT_EQ(stand.state(), "running");
}

TEST(Upload, HeadsInAnotherOrder_AreFoundByName) {
  Stand stand;
  TestHost& host = stand.bring_up();
  Calibration turned = small_calibration("turned");
  std::reverse(turned.heads.begin(), turned.heads.end());
  EXPECT_TRUE(host.upload(to_json(turned)).has_done());
  EXPECT_EQ(in_force(stand), calibration_id(turned));
}

TEST(Upload, TheDiskIsFull_ItSaysSoAndTheOldOneStays) {
  Stand stand;
  TestHost& host = stand.bring_up();
  const Sha256 old = in_force(stand);
  stand.disk->set_capacity(0);
  const std::string document = to_json(small_calibration("second"));
  const wire::Reply full = host.upload(document);
  EXPECT_EQ(full.error().code(), static_cast<unsigned>(Errc::kDiskFull)) << full.error().message();
  EXPECT_EQ(in_force(stand), old);
  EXPECT_EQ(stand.state(), "running");
  stand.disk->set_capacity(1 << 20);
  EXPECT_TRUE(host.upload(document).has_done());
  EXPECT_EQ(in_force(stand), calibration_id(small_calibration("second")));
}

TEST(Calibrations, ListUseRollbackAndGet_AgreeAboutWhatIsInForce) {
  Stand stand;
  TestHost& host = stand.bring_up();
  const Sha256 first = in_force(stand);
  ASSERT_TRUE(host.upload(to_json(small_calibration("second"))).has_done());
  const Sha256 second = in_force(stand);
  ASSERT_NE(first, second);

  wire::Request list;
  list.mutable_calibration_list();
  const wire::Calibrations listed = host.ask(list).calibrations();
  ASSERT_EQ(listed.entries_size(), 2);
  EXPECT_EQ(listed.entries(0).name(), "second");
  EXPECT_TRUE(listed.entries(0).in_force());
  EXPECT_FALSE(listed.entries(1).in_force());
  EXPECT_GT(listed.entries(0).generation(), listed.entries(1).generation());

  wire::Request rollback;
  rollback.mutable_calibration_rollback();
  EXPECT_TRUE(host.ask(rollback).has_done());
  EXPECT_EQ(in_force(stand), first);

  wire::Request use;
  use.mutable_calibration_use()->set_id(sha256_to_wire(second).substr(0, 4));
  EXPECT_TRUE(host.ask(use).has_done());
  EXPECT_EQ(in_force(stand), second);
  use.mutable_calibration_use()->set_id("\x01\x02\x03\x04\x05\x06");
  EXPECT_EQ(host.ask(use).error().code(), static_cast<unsigned>(Errc::kNotFound));

  wire::Request get;
  get.mutable_calibration_get();
  const wire::CalibrationDocument document = host.ask(get).calibration();
  EXPECT_EQ(document.id(), sha256_to_wire(second));
  const auto parsed = parse_calibration(document.json());
  ASSERT_TRUE(parsed);
  EXPECT_EQ(calibration_id(*parsed), second);
}

TEST(Calibrations, ASwap_FallsBetweenTwoSetsAndLosesNone) {
  Stand stand;
  TestHost& host = stand.bring_up();
  TestHost& watcher = stand.connect();
  const StreamId stream = watcher.pull(false, 0);
  stand.run(Duration::milliseconds(300));
  ASSERT_TRUE(host.upload(to_json(small_calibration("second"))).has_done());
  stand.run(Duration::milliseconds(300));
  const std::vector<Pulled>& got = watcher.pulled[stream];
  const std::string first = sha256_to_wire(calibration_id(small_calibration()));
  const std::string second = sha256_to_wire(calibration_id(small_calibration("second")));
  int swaps = 0;
  for (std::size_t i = 0; i < got.size(); ++i) {
    const std::string& id = got[i].header.calibration_id();
    EXPECT_TRUE(id == first || id == second);
    if (i == 0) continue;
    EXPECT_EQ(got[i].header.set(), got[i - 1].header.set() + 1) << "a set is missing at the swap";
    swaps += id != got[i - 1].header.calibration_id() ? 1 : 0;
  }
  EXPECT_EQ(swaps, 1);
  EXPECT_EQ(got.back().header.calibration_id(), second);
}

}  // namespace
}  // namespace nodal::scenario
