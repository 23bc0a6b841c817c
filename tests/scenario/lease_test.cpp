// Temporary settings of a host: the rig undoes them when the host is gone, in whatever way.
#include <gtest/gtest.h>

#include "firmware/hosts/client.h"
#include "tests/scenario/stand.h"

namespace nodal::scenario {
namespace {

constexpr std::uint64_t kKept = 8'000'000, kTemporary = 4'000'000, kOther = 6'000'000;

wire::Request exposure(std::uint32_t head, std::uint64_t ns, bool temporary) {
  wire::Request request;
  request.mutable_head_set()->add_heads(head);
  request.mutable_head_set()->set_exposure_ns(ns);
  request.mutable_head_set()->set_temporary(temporary);
  return request;
}

wire::Request end_of_temporary() {
  wire::Request request;
  request.mutable_head_set()->set_temporary(true);
  return request;
}

class Lease : public testing::Test {
 protected:
  Lease() {
    stand.lock(keeper);
    EXPECT_TRUE(keeper.ask(exposure(1, kKept, false)).has_done());
    stand.run(Duration::seconds(2));  // until the setting is stored
    EXPECT_TRUE(borrower.ask(exposure(1, kTemporary, true)).has_done());
    EXPECT_EQ(after_a_moment(), kTemporary);
  }
  std::uint64_t after_a_moment(Duration moment = Duration::milliseconds(300)) {
    stand.run(moment);
    return static_cast<std::uint64_t>(stand.capture().heads[1].in_effect.exposure.duration().ns());
  }
  std::vector<std::string> audited() {
    wire::Request request;
    request.mutable_audit_log();
    std::vector<std::string> texts;
    const wire::Reply reply = keeper.ask(request);
    for (const wire::AuditEntry& entry : reply.audit_log().entries()) {
      texts.push_back(entry.who() + ": " + entry.before() + " -> " + entry.after());
    }
    return texts;
  }

  Stand stand;
  TestHost& keeper{stand.bring_up()};
  TestHost& borrower{stand.connect()};
};

TEST_F(Lease, TheHostsLinkEnds_TheSettingIsUndoneAndAudited) {
  borrower.link().reset();
  EXPECT_EQ(after_a_moment(), kKept);
  const std::vector<std::string> texts = audited();
  ASSERT_FALSE(texts.empty());
  EXPECT_TRUE(texts.back().starts_with("end of the temporary settings of user 1000")) << texts.back();
  EXPECT_TRUE(texts.back().ends_with("temporary settings -> as before")) << texts.back();
}

TEST_F(Lease, TheHostFallsSilent_TheSettingIsUndoneAfterThePingsThatItDoesNotAnswer) {
  borrower.reading = false;
  EXPECT_EQ(after_a_moment(firmware::HostActivity::kLeaseSilent / 2), kTemporary);
  EXPECT_EQ(after_a_moment(firmware::HostActivity::kLeaseSilent), kKept);
}

TEST_F(Lease, TheHostOnlyAnswersPings_TheSettingStays) {
  EXPECT_EQ(after_a_moment(firmware::HostActivity::kLeaseSilent * 3), kTemporary);
  EXPECT_TRUE(borrower.ask(end_of_temporary()).has_done());
  EXPECT_EQ(after_a_moment(), kKept);
}

TEST_F(Lease, NodaldEndsWithoutNotice_TheNextStartHasTheKeptSetting) {
  const StandOptions options;
  Stand next(options, stand.disk->after_power_loss(3));
  ASSERT_TRUE(next.run_until([&] { return next.state() == "running"; }));
  next.run(Duration::seconds(1));
  EXPECT_EQ(next.capture().heads[1].in_effect.exposure.duration().ns(), static_cast<std::int64_t>(kKept));
}

TEST_F(Lease, AnotherHostKeepsAValueMeanwhile_ItStays) {
  EXPECT_TRUE(keeper.ask(exposure(1, kOther, false)).has_done());
  EXPECT_EQ(after_a_moment(), kOther);
  borrower.link().reset();
  EXPECT_EQ(after_a_moment(), kOther);
}

TEST_F(Lease, AnotherHostWantsTheSameHeadForAWhile_IsRefusedUntilTheFirstEnds) {
  const wire::Reply refused = keeper.ask(exposure(1, kOther, true));
  EXPECT_EQ(refused.error().code(), static_cast<std::uint32_t>(Errc::kBusy)) << refused.error().message();
  EXPECT_NE(refused.error().message().find("head 'cam1'"), std::string::npos) << refused.error().message();
  borrower.link().reset();
  EXPECT_EQ(after_a_moment(), kKept);
  EXPECT_TRUE(keeper.ask(exposure(1, kOther, true)).has_done());
  EXPECT_EQ(after_a_moment(), kOther);
}

TEST_F(Lease, SeveralTemporaryValues_TheOneBeforeTheFirstComesBack) {
  EXPECT_TRUE(borrower.ask(exposure(1, kOther, true)).has_done());
  EXPECT_TRUE(borrower.ask(exposure(1, kTemporary, true)).has_done());
  borrower.link().reset();
  EXPECT_EQ(after_a_moment(), kKept);
}

TEST_F(Lease, AValueThatNobodyEverSet_ComesBackToo) {
  const std::uint64_t before = static_cast<std::uint64_t>(stand.capture().heads[2].in_effect.exposure.duration().ns());
  EXPECT_TRUE(borrower.ask(exposure(2, before / 2, true)).has_done());
  stand.run(Duration::milliseconds(300));
  EXPECT_EQ(stand.capture().heads[2].in_effect.exposure.duration().ns(), static_cast<std::int64_t>(before / 2));
  borrower.link().reset();
  stand.run(Duration::milliseconds(300));
  EXPECT_EQ(stand.capture().heads[2].in_effect.exposure.duration().ns(), static_cast<std::int64_t>(before));
}

TEST_F(Lease, TheHeadIsGoneWhenTheHostEnds_ItComesBackWithTheKeptSetting) {
  stand.world.head(1).unplug();
  stand.run(Duration::milliseconds(300));
  borrower.link().reset();
  stand.run(Duration::milliseconds(300));
  stand.world.head(1).replug();
  EXPECT_EQ(after_a_moment(Duration::seconds(2)), kKept);
}

TEST_F(Lease, TheHeadComesBackWhileTheHostStays_ItHasTheTemporarySetting) {
  stand.world.head(1).unplug();
  stand.run(Duration::milliseconds(300));
  stand.world.head(1).replug();
  EXPECT_EQ(after_a_moment(Duration::seconds(2)), kTemporary);
  borrower.link().reset();
  EXPECT_EQ(after_a_moment(), kKept);
}

}  // namespace
}  // namespace nodal::scenario
