#include "firmware/operate/change_audit.h"

#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "hal/sim/disk.h"

namespace nodal::firmware {
namespace {

class ChangeAuditTest : public testing::Test {
 protected:
  ChangeAuditTest() { step(); }
  /// The audit and its store exchange all that they have; the tickets that are answered by that.
  std::vector<Ticket> step() {
    std::vector<Answer> answers;
    for (int round = 0; round < 4; ++round) {
      audit_.step(false, answers, now_);
      while (store_.step(now_)) continue;
    }
    std::vector<Ticket> tickets;
    for (const Answer& answer : answers) {
      tickets.push_back(answer.ticket);
      not_recorded_ = answer.not_recorded;
    }
    return tickets;
  }
  ChangeAudit::Receipt deletes_take() {
    return audit_.note_change(user_, TakeCommand(TakeRequest::Delete{7, {}}), "there", "take 7 deleted", {}, now_);
  }

  hal::sim::SimDisk disk_;
  Instant now_;
  AuditStore store_{disk_};
  News news_{Instant()};
  ChangeAudit audit_{store_, [] { return std::int64_t{1'700'000'000'000'000'000}; }, news_};
  const Requester user_{Requester::Kind::kHost, 3, "user 1000, process 7, host 3", "user 1000 at the control socket"};
  std::string not_recorded_ = "no answer";
};

TEST_F(ChangeAuditTest, AnImportantChange_IsAnsweredWhenItsEntryIsOnTheDisk) {
  std::vector<Answer> answers;
  audit_.answer_when_recorded({5, CommandDone()}, deletes_take());
  audit_.step(false, answers, now_);
  EXPECT_TRUE(answers.empty()) << "the store has not written";
  EXPECT_EQ(audit_.waiting(), 1u);
  EXPECT_EQ(step(), std::vector<Ticket>{5});
  EXPECT_EQ(not_recorded_, "");
  EXPECT_EQ(audit_.waiting(), 0u);
  const auto entries = audit_.log().entries(0, 0);
  ASSERT_EQ(entries.size(), 1u);
  EXPECT_EQ(entries[0].who, "user 1000, process 7, host 3");
  EXPECT_EQ(entries[0].what, "take_delete");
  EXPECT_EQ(entries[0].before, "there");
  EXPECT_EQ(entries[0].after, "take 7 deleted");
}

TEST_F(ChangeAuditTest, TheDiskFails_TheAnswerSaysThatItIsNotRecordedAndTheLogOnce) {
  news_.take();
  disk_.be_read_only(true);
  audit_.answer_when_recorded({5, CommandDone()}, deletes_take());
  EXPECT_EQ(step(), std::vector<Ticket>{5});
  EXPECT_NE(not_recorded_, "");
  EXPECT_EQ(not_recorded_, audit_.problem());
  step();
  int said = 0;
  for (const std::string& sentence : news_.take()) said += sentence == audit_.problem() ? 1 : 0;
  EXPECT_EQ(said, 1);
}

TEST_F(ChangeAuditTest, QueriesAndMergedEntries_WaitForNothing) {
  disk_.be_read_only(true);
  deletes_take();
  step();
  ASSERT_NE(audit_.problem(), "");
  audit_.answer_when_recorded({6, CommandDone()}, 0);
  EXPECT_EQ(step(), std::vector<Ticket>{6});
  EXPECT_EQ(not_recorded_, "") << "nothing of it had to be recorded";
}

TEST_F(ChangeAuditTest, EveryKindOfEntry_HasItsAuthorAndItsWords) {
  audit_.note_refused(user_, "head_set", Error{Errc::kBadValue, "no such head"}, now_);
  audit_.note_take_read(user_, 12, now_);
  audit_.note_host_end(user_, "host 9 at usb", now_);
  audit_.note_own_change("trial", "calibration_use", "new", "old", now_);
  step();
  const auto entries = audit_.log().entries(0, 0);
  ASSERT_EQ(entries.size(), 4u);
  EXPECT_EQ(entries[0].error->message, "no such head");
  EXPECT_EQ(entries[1].after, "take 12 is read");
  EXPECT_EQ(entries[2].what, "host_end");
  EXPECT_EQ(entries[2].before, "host 9 at usb");
  EXPECT_EQ(entries[3].who, "trial");
  EXPECT_EQ(entries[3].after, "old");
}

TEST_F(ChangeAuditTest, AParty_HasItsOwnQuotaOfImportantChanges) {
  for (std::uint32_t k = 0; k < AuditLog::kImportantBurst; ++k) {
    ASSERT_TRUE(audit_.may_change(user_, true, now_)) << k;
    deletes_take();
    step();
  }
  EXPECT_FALSE(audit_.may_change(user_, true, now_));
  EXPECT_TRUE(audit_.may_change(user_, false, now_));
  EXPECT_TRUE(audit_.may_change({Requester::Kind::kButton, 0, "the button"}, true, now_));
}

}  // namespace
}  // namespace nodal::firmware
