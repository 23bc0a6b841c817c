#include "firmware/hosts/replies.h"

#include <gtest/gtest.h>

#include <memory>
#include <vector>

#include "hal/sim/link.h"

namespace nodal::firmware {
namespace {

/// Two hosts that said hello, with the numbers 1 and 2.
class RepliesTest : public testing::Test {
 protected:
  RepliesTest() {
    for (std::uint64_t number = 1; number <= 2; ++number) {
      auto ends = hal::sim::make_link_pair();
      clients_.push_back(
          std::make_unique<Client>(number, std::move(ends.first), Access::kControl, make_hello("a rig"), Instant()));
      links_.push_back(std::move(ends.second));
      hosts_.push_back(std::make_unique<Session>(Role::kHost, make_hello("a host")));
      exchange(number - 1);
    }
  }
  Client& client(std::size_t which) { return *clients_[which]; }
  /// Both ends of a connection say what they have to say.
  void exchange(std::size_t which) {
    Session& host = *hosts_[which];
    for (int round = 0; round < 3; ++round) {
      while (!host.output().empty()) host.sent(links_[which]->write(host.output()).value());
      client(which).pump_in(Instant());
      while (client(which).session().next_event()) continue;
      client(which).pump_out(Instant());
      std::vector<std::uint8_t> bytes(1 << 16);
      bytes.resize(links_[which]->read(bytes).value_or(0));
      ASSERT_TRUE(host.receive(bytes));
    }
  }
  std::vector<wire::Reply> replies(std::size_t which) {
    exchange(which);
    std::vector<wire::Reply> found;
    while (auto event = hosts_[which]->next_event()) {
      if (auto* reply = std::get_if<wire::Reply>(&*event)) found.push_back(std::move(*reply));
    }
    return found;
  }

  RigConfig config_;
  Clients clients_;
  std::vector<std::unique_ptr<hal::sim::SimLink>> links_;
  std::vector<std::unique_ptr<Session>> hosts_;
  Replies replies_{config_, clients_};
};

TEST_F(RepliesTest, AnAnswer_GoesToTheHostThatWaitsForItsTicketWithTheIdOfItsRequest) {
  replies_.await(client(0), 41, 7);
  replies_.await(client(1), 42, 8);
  EXPECT_EQ(replies_.waiting(), 2u);
  EXPECT_EQ(client(1).requests_open, 1u);
  replies_.settle({8, fail(Errc::kBusy, "another one")}, Instant());
  EXPECT_EQ(replies_.waiting(), 1u);
  EXPECT_EQ(client(1).requests_open, 0u);
  EXPECT_EQ(client(0).requests_open, 1u);
  EXPECT_TRUE(replies(0).empty());
  const auto sent = replies(1);
  ASSERT_EQ(sent.size(), 1u);
  EXPECT_EQ(sent[0].id(), 42u);
  EXPECT_EQ(sent[0].error().message(), "another one");
  replies_.settle({8, fail(Errc::kBusy, "again")}, Instant());
  EXPECT_TRUE(replies(1).empty()) << "a ticket is answered once";
}

TEST_F(RepliesTest, AnAnswerForAHostThatHasLeft_GoesNowhere) {
  replies_.await(client(0), 41, 7);
  clients_.erase(clients_.begin());
  EXPECT_EQ(replies_.waiting(), 1u);
  replies_.settle({7, fail(Errc::kBusy, "")}, Instant());
  EXPECT_EQ(replies_.waiting(), 0u);
  EXPECT_FALSE(find_client(clients_, 1));
  EXPECT_EQ(find_client(clients_, 2), clients_[0].get());
}

TEST_F(RepliesTest, AnAnswerThatNobodyWaitsFor_IsNoError) {
  replies_.settle({99, CommandDone()}, Instant());
  EXPECT_TRUE(replies(0).empty());
  EXPECT_TRUE(replies(1).empty());
}

TEST_F(RepliesTest, ARefusal_HasTheRequestsIdAndTheReason) {
  replies_.refuse(client(0), 5, Error{Errc::kUnsupported, "not on this rig"}, Instant());
  const auto sent = replies(0);
  ASSERT_EQ(sent.size(), 1u);
  EXPECT_EQ(sent[0].id(), 5u);
  EXPECT_EQ(sent[0].error().code(), static_cast<std::uint32_t>(Errc::kUnsupported));
  EXPECT_EQ(sent[0].error().message(), "not on this rig");
}

TEST_F(RepliesTest, AHostThatDoesNotReadItsReplies_LosesItsConnection) {
  wire::Reply large;
  large.mutable_calibration()->set_json(std::string(1 << 20, 'x'));
  for (int k = 0; k < 4 && !client(0).ending(); ++k) replies_.send(client(0), large, Instant());
  EXPECT_TRUE(client(0).ending());
  EXPECT_FALSE(client(1).ending());
}

}  // namespace
}  // namespace nodal::firmware
