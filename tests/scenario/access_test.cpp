// Control and view-only hosts, and the audit log of the changes by control hosts.
#include <gtest/gtest.h>

#include <algorithm>

#include "tests/scenario/stand.h"

namespace nodal::scenario {
namespace {

wire::Request exposure_of_all(std::uint64_t ns) {
  wire::Request request;
  request.mutable_head_set()->set_exposure_ns(ns);
  return request;
}

wire::Request genlock(wire::GenlockRequest::Action action) {
  wire::Request request;
  request.mutable_genlock()->set_action(action);
  return request;
}

wire::AuditLog audit_of(TestHost& host) {
  wire::Request request;
  request.mutable_audit_log();
  return host.ask(request).audit_log();
}

constexpr auto kNotPermitted = static_cast<std::uint32_t>(Errc::kUnsupported);

TEST(ViewOnly, PullsAndLooks_ButChangesNothing) {
  Stand stand;
  TestHost& control = stand.bring_up();
  TestHost& viewer = stand.connect_to_view();
  stand.settle();
  const auto& features = viewer.session().peer_hello()->features();
  EXPECT_TRUE(std::any_of(features.begin(), features.end(), [](const auto& one) { return one == "view-only"; }));
  EXPECT_EQ(viewer.status().state(), "running");
  EXPECT_EQ(viewer.heads().heads_size(), kHeads);
  const StreamId stream = viewer.pull(true, 3);
  ASSERT_NE(stream, 0u);
  EXPECT_TRUE(stand.run_until([&] { return viewer.closed.contains(stream); }));
  EXPECT_EQ(viewer.pulled[stream].size(), 3u);

  const std::uint64_t before = control.heads().heads(0).exposure_ns();
  EXPECT_EQ(viewer.ask(exposure_of_all(123'000)).error().code(), kNotPermitted);
  EXPECT_EQ(viewer.ask(genlock(wire::GenlockRequest::START)).error().code(), kNotPermitted);
  EXPECT_EQ(viewer.pull(false, 1, true), 0u) << "an overloaded board sheds nothing of a lossless pull";
  stand.run(Duration::seconds(1));
  EXPECT_EQ(control.heads().heads(0).exposure_ns(), before);
  EXPECT_EQ(control.status().genlock().state(), "off");
  EXPECT_EQ(viewer.ask(genlock(wire::GenlockRequest::SHOW)).genlock().state(), "off");
}

TEST(ViewOnly, BytesForAnUploadThatAControlHostBegan_AreNotTaken) {
  Stand stand;
  TestHost& control = stand.bring_up();
  TestHost& viewer = stand.connect_to_view();
  stand.settle();
  const std::string document = to_json(small_calibration("half"));
  const auto bytes = std::make_shared<const std::vector<std::uint8_t>>(document.begin(), document.end());
  const UploadSender sender(bytes);
  wire::Request begin;
  *begin.mutable_upload_begin() = sender.begin();
  ASSERT_EQ(control.ask(begin).upload().offset(), 0u);
  const auto stream = viewer.session().open_stream(StreamPolicy::kLossless);
  ASSERT_TRUE(stream);
  ASSERT_TRUE(viewer.session().offer(*stream, *sender.item(0)));
  stand.run(Duration::milliseconds(100));
  EXPECT_EQ(control.ask(begin).upload().offset(), 0u) << "bytes of a viewer became part of an upload";
}

TEST(Operate, FilmsAndSetsTheHeads_ButChangesNoCalibrationAndEndsNoHost) {
  StandOptions options;
  options.config.takes = firmware::TakesConfig{.folder = "takes", .buffer_mb = 16};
  Stand stand(std::move(options));
  TestHost& control = stand.bring_up();
  TestHost& operating = stand.connect_to_operate();
  stand.settle();
  const auto& features = operating.session().peer_hello()->features();
  EXPECT_TRUE(std::any_of(features.begin(), features.end(), [](const auto& one) { return one == "operate-only"; }));
  ASSERT_TRUE(stand.run_until([&] { return stand.rig->takes().snapshot().read().ready; }));
  wire::Request start;
  start.mutable_take_start();
  EXPECT_EQ(operating.ask(start).take().take(), 1u);
  EXPECT_TRUE(operating.ask(exposure_of_all(2'000'000)).has_done());
  stand.run(Duration::milliseconds(500));
  wire::Request stop;
  stop.mutable_take_stop();
  EXPECT_EQ(operating.ask(stop).take().take(), 1u);
  wire::Request gone;
  gone.mutable_take_delete()->set_take(1);
  EXPECT_EQ(operating.ask(gone).error().code(), kNotPermitted);
  wire::Request end;
  end.mutable_host_end()->set_number(1);
  EXPECT_EQ(operating.ask(end).error().code(), kNotPermitted);
  EXPECT_EQ(operating.upload(to_json(small_calibration("another"))).error().code(), kNotPermitted);
  EXPECT_FALSE(control.dead());
  const wire::RigStatus status = operating.status();
  EXPECT_EQ(status.clock_ns(), static_cast<std::uint64_t>(stand.world.clock().now().ns()));
  EXPECT_EQ(status.recording().total_bytes(), stand.takes->total_bytes().value());
  EXPECT_GT(status.recording().free_bytes(), 0u);
}

TEST(Audit, ForWhomAHostSaysThatItAsks_IsShownAsItsClaim) {
  Stand stand;
  TestHost& host = stand.bring_up();
  wire::Request request = exposure_of_all(4'000'000);
  request.set_on_behalf("Jürgen's phone");
  EXPECT_TRUE(host.ask(request).has_done());
  const std::vector<std::string> bad{std::string(65, 'a'), "two\nlines", "a\" for \"b"};
  for (const std::string& claim : bad) {
    request.set_on_behalf(claim);
    EXPECT_EQ(host.ask(request).error().code(), static_cast<std::uint32_t>(Errc::kBadValue)) << claim;
  }
  request.set_on_behalf(std::string(64, 'a'));
  EXPECT_TRUE(host.ask(request).has_done());
  const wire::AuditLog log = audit_of(host);
  ASSERT_EQ(log.entries_size(), 3) << "the upload, and the two that were carried out";
  EXPECT_TRUE(log.entries(1).who().ends_with(" for \"Jürgen's phone\"")) << log.entries(1).who();
  EXPECT_TRUE(log.entries(1).who().starts_with("user 1000, process 4711, host 1 ")) << log.entries(1).who();
  EXPECT_TRUE(log.entries(2).who().ends_with(" for \"" + std::string(64, 'a') + "\"")) << log.entries(2).who();
}

TEST(Audit, AChange_IsKeptWithWhoOldAndNewValueAndResult) {
  Stand stand;
  TestHost& host = stand.bring_up();
  stand.rig->control().take_news();
  const std::uint64_t old = host.heads().heads(2).exposure_ns();
  wire::Request good = exposure_of_all(4'000'000);
  good.mutable_head_set()->add_heads(2);
  EXPECT_TRUE(host.ask(good).has_done());
  wire::Request bad = exposure_of_all(4'000'000);
  bad.mutable_head_set()->add_heads(99);
  EXPECT_TRUE(host.ask(bad).has_error());
  host.status();

  const wire::AuditLog log = audit_of(host);
  ASSERT_EQ(log.entries_size(), 3) << "the upload, and these two; questions are no changes";
  EXPECT_EQ(log.entries(0).what(), "upload_commit");
  EXPECT_EQ(log.entries(0).before(), "no calibration");
  EXPECT_EQ(log.entries(0).after(), "calibration " + to_hex(calibration_id(small_calibration())).substr(0, 12));
  const wire::AuditEntry& set = log.entries(1);
  EXPECT_EQ(set.who().find("user 1000, process 4711, host 1 at sim:host1"), 0u) << set.who();
  EXPECT_EQ(set.what(), "head_set");
  EXPECT_EQ(set.before(), "head 2: exposure " + std::to_string(old) + " ns");
  EXPECT_EQ(set.after(), "heads 2: exposure 4000000 ns");
  EXPECT_FALSE(set.has_error());
  EXPECT_LE(set.at_ns(), log.now_ns());
  EXPECT_EQ(log.entries(2).error().code(), static_cast<std::uint32_t>(Errc::kBadValue));

  const std::vector<std::string> news = stand.rig->control().take_news();
  EXPECT_EQ(std::count_if(news.begin(), news.end(), [](const auto& line) { return line.starts_with("audit: "); }), 2);
}

TEST(Audit, TheButtonAndTheSettingsOfTheLastStart_AreChangesToo) {
  Stand stand;
  TestHost& host = stand.bring_up();
  host.ask(exposure_of_all(3'000'000));
  const Instant now = stand.world.clock().now();
  stand.button.script(now, true);
  stand.button.script(now + Duration::milliseconds(200), false);
  stand.run(Duration::seconds(2));
  const wire::AuditLog log = audit_of(host);
  EXPECT_TRUE(std::any_of(log.entries().begin(), log.entries().end(), [](const wire::AuditEntry& entry) {
    return entry.who() == "button" && entry.what() == "genlock" && entry.after() == "start";
  }));

  Stand again({}, stand.disk->after_power_loss(1));
  TestHost& other = again.connect();
  again.run(Duration::seconds(2));
  const wire::AuditLog restored = audit_of(other);
  EXPECT_TRUE(std::any_of(restored.entries().begin(), restored.entries().end(), [](const wire::AuditEntry& entry) {
    return entry.who() == "stored settings" && entry.what() == "head_set";
  }));
}

}  // namespace
}  // namespace nodal::scenario
