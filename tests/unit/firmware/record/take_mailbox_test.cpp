#include "firmware/record/take_mailbox.h"

#include <gtest/gtest.h>

#include <utility>
#include <vector>

namespace nodal::firmware {
namespace {

constexpr auto kDone = Errc();

class TakeMailboxTest : public testing::Test {
 protected:
  void ask(std::uint64_t ticket, const Presence& host = {}) {
    ASSERT_TRUE(mail_.requests().push({ticket, TakeRequest::List(), host}));
  }
  /// Tickets and error codes of the answers, in order.
  std::vector<std::pair<std::uint64_t, Errc>> answers() {
    std::vector<std::pair<std::uint64_t, Errc>> all;
    while (auto answer = mail_.answers().pop())
      all.emplace_back(answer->ticket, answer->result ? kDone : answer->result.error().code);
    return all;
  }

  TakeMailbox mail_;
};

using Answers = std::vector<std::pair<std::uint64_t, Errc>>;

TEST_F(TakeMailboxTest, RequestsOfHostsThatHaveGone_AreAnsweredAndPassedOver) {
  const Presence gone = Presence::of_host(), here = Presence::of_host();
  ask(1, gone);
  ask(2, gone);
  ask(3, here);
  ask(4);
  gone.end();
  EXPECT_EQ(mail_.next()->ticket, 3u);
  EXPECT_EQ(answers(), (Answers{{1, Errc::kCancelled}, {2, Errc::kCancelled}}));
  EXPECT_EQ(mail_.next()->ticket, 4u) << "the rig itself never goes";
  EXPECT_FALSE(mail_.next());
  EXPECT_TRUE(answers().empty());
}

TEST_F(TakeMailboxTest, AllThatWait_GetTheSameAnswer) {
  WaitingTickets waiting;
  for (std::uint64_t ticket = 1; ticket <= 3; ++ticket) mail_.let_wait(waiting, {ticket, TakeRequest::Eject()});
  EXPECT_TRUE(answers().empty());
  mail_.answer(waiting, fail(Errc::kIo, "the disk"));
  EXPECT_EQ(answers(), (Answers{{1, Errc::kIo}, {2, Errc::kIo}, {3, Errc::kIo}}));
  EXPECT_TRUE(waiting.empty());
}

TEST_F(TakeMailboxTest, AHostThatLeavesWhileItWaits_GivesItsPlaceUp) {
  const Presence host = Presence::of_host();
  WaitingTickets waiting;
  mail_.let_wait(waiting, {1, TakeRequest::Eject(), host});
  mail_.let_wait(waiting, {2, TakeRequest::Eject()});
  EXPECT_FALSE(mail_.drop_gone(waiting));
  host.end();
  EXPECT_TRUE(mail_.drop_gone(waiting));
  EXPECT_EQ(answers(), (Answers{{1, Errc::kCancelled}}));
  mail_.answer(waiting, TakeAnswer::Done{7});
  EXPECT_EQ(answers(), (Answers{{2, kDone}}));
}

TEST_F(TakeMailboxTest, MoreThanMayWait_TheOldestIsRefused) {
  WaitingTickets waiting;
  for (std::uint64_t ticket = 1; ticket <= kMaxWaitingTickets; ++ticket)
    mail_.let_wait(waiting, {ticket, TakeRequest::Eject()});
  EXPECT_TRUE(answers().empty());
  mail_.let_wait(waiting, {kMaxWaitingTickets + 1, TakeRequest::Eject()});
  EXPECT_EQ(answers(), (Answers{{1, Errc::kOverload}}));
}

TEST_F(TakeMailboxTest, AHostThatHasGone_MakesRoomBeforeTheOldestIsRefused) {
  const Presence host = Presence::of_host();
  WaitingTickets waiting;
  for (std::uint64_t ticket = 1; ticket <= kMaxWaitingTickets; ++ticket)
    mail_.let_wait(waiting, {ticket, TakeRequest::Eject(), ticket == 5 ? host : Presence()});
  host.end();
  mail_.let_wait(waiting, {kMaxWaitingTickets + 1, TakeRequest::Eject()});
  EXPECT_EQ(answers(), (Answers{{5, Errc::kCancelled}}));
}

}  // namespace
}  // namespace nodal::firmware
