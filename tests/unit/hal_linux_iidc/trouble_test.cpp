// An IIDC head on a camera that fails, lies or disappears.
#include <cerrno>
#include <set>

#include "hal/linux/iidc/head.h"
#include "head_fixture.h"

namespace nodal::hal::iidc {
namespace {

TEST_F(IidcHeadTest, EveryFault_OfOpening_IsOneSentenceAndLeavesNothingOpen) {
  struct Case {
    int error;
    Errc code;
    const char* says;
  };
  for (const Case& one : {Case{EBUSY, Errc::kBusy, "another program"}, Case{EIO, Errc::kDeviceFailed, "unplug it"},
                          Case{EACCES, Errc::kDeviceFailed, "group video"}}) {
    bus_.refuse_opening(one.error);
    expect_says(refusal(), one.code, one.says);
  }
  bus_.refuse_opening(0);
  bus_.before_read = [](std::uint64_t offset) { return offset == Registers::kBase + 0x500 + 4 * 7 ? EIO : 0; };
  expect_says(refusal(), Errc::kDeviceFailed, "reading the shutter");
  EXPECT_EQ(bus_.open_devices(), 0);
}

// Every single register access of opening and starting fails once.
TEST_F(IidcHeadTest, AnyAccessFails_ItIsAnErrorOrTheHeadWorksWithoutAndNothingIsLeft) {
  int accesses = 0, failing = -1, errors = 0;
  const auto count = [&] { return accesses++ == failing ? EIO : 0; };
  bus_.before_read = [&](std::uint64_t) { return count(); };
  bus_.before_write = [&](std::uint64_t, std::uint32_t) { return count(); };
  int needed = 0;
  for (failing = -1; failing < needed; ++failing) {
    accesses = 0;
    {
      auto head = open();
      if (head) {
        ASSERT_TRUE((*head)->start(TriggerMode::kFreeRun));
        const auto frame = next(**head);
        if (failing < 0) needed = accesses;
        ASSERT_TRUE(frame || frame.error().code == Errc::kDeviceFailed) << failing;
        errors += frame ? 0 : 1;
      } else {
        ASSERT_EQ(head.error().code, Errc::kDeviceFailed) << failing << ": " << head.error().message;
        ++errors;
      }
    }
    enumerator_->settle();
    ASSERT_EQ(bus_.open_devices(), 0) << failing;
    ASSERT_EQ(bus_.sources(), 0) << failing;
  }
  EXPECT_GT(needed, 60);
  EXPECT_GE(errors, needed - 5) << "only the embedded numbers are not needed";
}

TEST_F(IidcHeadTest, Unplugged_WhileIdle_WhileStreaming_InAControl_NamesTheHeadAndOpensAgainLater) {
  for (const int when : {0, 1, 2}) {
    auto head = when == 0 ? opened() : streaming();
    if (when > 0) pass_frame(*head);
    bus_.unplug();
    if (when == 0) {
      ASSERT_TRUE(head->start(TriggerMode::kFreeRun));
    } else if (when == 2) {
      ASSERT_TRUE(head->set_exposure(Exposure::microseconds(500)));
    }
    const auto frame = next(*head);
    ASSERT_FALSE(frame) << when;
    expect_says(frame.error(), Errc::kDeviceGone, "plug it in again");
    expect_says(refusal(), Errc::kNoSuchDevice, "there is: none");
    bus_.plug_in();
    const auto again = streaming();
    EXPECT_EQ(pass_frame(*again).verdict, FrameVerdict::kGood);
    EXPECT_EQ(head->take_frame().error().code, Errc::kDeviceGone);
  }
}

TEST_F(IidcHeadTest, TornAndDamagedFrames_HaveTheirVerdictAndTheNextIsGood) {
  const auto head = streaming();
  bus_.tear(1);
  bus_.damage(2);
  std::vector<FrameVerdict> verdicts;
  for (int i = 0; i < 4; ++i) verdicts.push_back(pass_frame(*head).verdict);
  EXPECT_EQ(verdicts,
            (std::vector{FrameVerdict::kGood, FrameVerdict::kTorn, FrameVerdict::kCorrupt, FrameVerdict::kGood}));
}

TEST_F(IidcHeadTest, PicturesThatBeginInTheMiddleOfATransfer_AreCorruptUntilTheStreamIsBegunAgain) {
  const auto head = streaming();
  pass_frames(*head, 3);
  bus_.displace();
  EXPECT_EQ(pass_frame(*head).verdict, FrameVerdict::kCorrupt);
  EXPECT_EQ(head->recoveries().restarts, 1U);
  for (int i = 0; i < 10; ++i) EXPECT_EQ(pass_frame(*head).verdict, FrameVerdict::kGood);
  EXPECT_EQ(head->recoveries().restarts, 1U);
}

TEST_F(IidcHeadTest, AStreamThatBreaks_IsBegunAgainAndLentFramesStayWhatTheyWere) {
  const auto head = streaming();
  const auto lent = next(*head);
  ASSERT_TRUE(lent);
  const std::uint8_t held = lent->image.planes[0].data[700];
  bus_.break_stream(2);
  std::set<BufferSlot> slots;
  for (int i = 0; i < 12; ++i) {
    const auto frame = next(*head);
    ASSERT_TRUE(frame) << frame.error().text();
    slots.insert(frame->slot);
    if (i == 6) head->release(lent->slot);
    if (i < 6) {
      EXPECT_NE(frame->slot, lent->slot);
      EXPECT_EQ(lent->image.planes[0].data[700], held);
    }
    head->release(frame->slot);
  }
  EXPECT_EQ(head->recoveries().restarts, 2U);
  EXPECT_TRUE(slots.contains(lent->slot)) << "its buffer is used again";
}

TEST_F(IidcHeadTest, AStreamThatBreaksEveryTime_FailsForGood) {
  bus_.break_stream(1'000'000);
  auto head = streaming();
  const auto frame = next(*head);
  ASSERT_FALSE(frame);
  expect_says(frame.error(), Errc::kDeviceFailed, "5 times in a row");
  EXPECT_EQ(head->recoveries().restarts, static_cast<std::uint64_t>(IidcHead::kMaxRestarts));
  bus_.break_stream(0);
  head.reset();
  EXPECT_EQ(pass_frame(*streaming()).verdict, FrameVerdict::kGood);
}

TEST_F(IidcHeadTest, ABufferThatIsRefusedOnce_IsCountedAndReturnedLater) {
  request_.buffers = 2;
  const auto head = streaming();
  bus_.refuse_buffers(1);
  pass_frames(*head, 8);
  EXPECT_EQ(head->recoveries(), (HeadRecoveries{0, 1}));
}

TEST_F(IidcHeadTest, ACameraThatFallsSilent_IsNoErrorAndItsFramesComeWhenItSpeaksAgain) {
  const auto head = streaming();
  pass_frame(*head);
  bus_.fall_silent(true);
  pass(period_ * 20);
  const auto nothing = head->take_frame();
  ASSERT_TRUE(nothing);
  EXPECT_FALSE(*nothing);
  bus_.fall_silent(false);
  EXPECT_GT(pass_frame(*head).sequence, 20U);
}

TEST_F(IidcHeadTest, ClosedOrStopped_ItDoesNotTransmitAndHasNoBuffers) {
  auto head = streaming();
  pass_frame(*head);
  EXPECT_EQ(bus_.sources(), 1);
  head->stop();
  enumerator_->settle();
  EXPECT_FALSE(bus_.transmits());
  EXPECT_EQ(bus_.sources(), 0);
  ASSERT_TRUE(head->start(TriggerMode::kFreeRun));
  pass_frame(*head);
  head.reset();
  enumerator_->settle();
  EXPECT_FALSE(bus_.transmits());
  EXPECT_EQ(bus_.sources(), 0);
  EXPECT_EQ(bus_.open_devices(), 0);
}

}  // namespace
}  // namespace nodal::hal::iidc
