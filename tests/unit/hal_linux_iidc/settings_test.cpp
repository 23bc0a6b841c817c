// Exposure, gain and white balance of an IIDC head, and the numbers embedded in its pictures.
#include <atomic>
#include <cerrno>
#include <chrono>
#include <future>
#include <memory>
#include <thread>

#include "head_fixture.h"

namespace nodal::hal::iidc {
namespace {

TEST_F(IidcHeadTest, Opened_NothingIsAutomaticAndTheLimitsAreTheCameras) {
  const auto head = opened();
  for (const std::uint32_t offset : {0x81CU, 0x820U, 0x83CU}) {
    EXPECT_EQ(bus_.registers.get(offset) & (kOnBit | kAutoBit | kAbsoluteBit), kOnBit | kAbsoluteBit) << offset;
  }
  EXPECT_EQ(bus_.registers.get(0x80C) & (kOnBit | kAutoBit), kOnBit);
  EXPECT_EQ(bus_.registers.get(0x804) & (kOnBit | kAutoBit), 0U) << "the automatic exposure is off";
  EXPECT_EQ(head->limits().exposure_min, Exposure::microseconds(100));
  EXPECT_EQ(head->limits().exposure_max, Exposure::microseconds(30'100));
  EXPECT_EQ(head->limits().gain_min, Gain::millidecibels(0));
  EXPECT_EQ(head->limits().gain_max, Gain::millidecibels(24'000));
  EXPECT_TRUE(head->limits().has_white_balance);
}

TEST_F(IidcHeadTest, ExposureGainAndBalance_AreInTheRegistersAndInTheFrames) {
  const auto head = streaming();
  pass_frame(*head);
  ASSERT_TRUE(head->set_exposure(Exposure::microseconds(12'340)));
  ASSERT_TRUE(head->set_gain(Gain::millidecibels(7'250)));
  ASSERT_TRUE(head->set_white_balance({8192, 2048}));
  // The worker sets one after the other, while frames go on.
  FrameView frame = pass_frames(*head, 5);
  for (int more = 0; more < 500 && frame.in_effect.white_balance.blue_q12 != 2048; ++more) {
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
    frame = pass_frames(*head, 1);
  }
  EXPECT_FLOAT_EQ(bus_.registers.absolute(Registers::kShutter), 0.01234F);
  EXPECT_FLOAT_EQ(bus_.registers.absolute(Registers::kGain), 7.25F);
  EXPECT_EQ(bus_.registers.get(0x80C) & 0xFF'FFFF, 256U << 12 | 1023U) << "1.0 is the middle, 512; 2.0 is over the end";
  EXPECT_EQ(frame.in_effect.exposure, Exposure::microseconds(12'340));
  EXPECT_EQ(frame.in_effect.gain, Gain::millidecibels(7'250));
  EXPECT_EQ(frame.in_effect.white_balance.blue_q12, 2048);
  EXPECT_EQ(frame.in_effect.white_balance.red_q12, 8184) << "1023 / 512";
}

TEST_F(IidcHeadTest, AnExposureThatTheCameraShortens_IsStatedAsItIs) {
  const auto head = streaming();
  pass_frame(*head);
  bus_.registers.set_absolute_high(Registers::kShutter, 0.008F);  // as in a mode with a shorter frame
  ASSERT_TRUE(head->set_exposure(Exposure::microseconds(20'000)));
  EXPECT_EQ(pass_frames(*head, 6).in_effect.exposure, Exposure::microseconds(8'000));
  EXPECT_FLOAT_EQ(bus_.shutter(), 0.008F);
}

TEST_F(IidcHeadTest, AWriteThatFails_ChangesNothingAndFramesGoOn) {
  const auto head = streaming();
  const Exposure before = pass_frame(*head).in_effect.exposure;
  bus_.before_write = [](std::uint64_t offset, std::uint32_t) {
    return offset >= Registers::kAbsolute && offset < Registers::kFormat7 ? EIO : 0;
  };
  ASSERT_TRUE(head->set_exposure(Exposure::microseconds(20'000)));
  const FrameView frame = pass_frames(*head, 6);
  EXPECT_EQ(frame.in_effect.exposure, before);
  EXPECT_EQ(frame.verdict, FrameVerdict::kGood);
  EXPECT_EQ(head->recoveries(), HeadRecoveries{});
}

TEST_F(IidcHeadTest, AnAutomaticModeThatStaysOn_IsAnError) {
  bus_.ignore_writes(0x81C);
  expect_says(refusal(), Errc::kDeviceFailed, "setting the shutter to manual");
}

TEST_F(IidcHeadTest, GainWithoutDecibels_IsSetInStepsOfTheRequest) {
  bus_.registers.set(0x520, bus_.registers.get(0x520) & ~kAbsoluteBit);
  EXPECT_EQ(opened()->limits().gain_max, Gain::millidecibels(0)) << "without a step it is not changed";
  request_.gain_step_mdb = 50;
  const auto head = streaming();
  EXPECT_EQ(head->limits().gain_max, Gain::millidecibels(24'000));
  ASSERT_TRUE(head->set_gain(Gain::millidecibels(5'020)));
  const FrameView frame = pass_frames(*head, 5);
  EXPECT_EQ(bus_.registers.get(0x820) & 0xFFF, 100U);
  EXPECT_EQ(frame.in_effect.gain, Gain::millidecibels(5'000));
}

TEST_F(IidcHeadTest, WithoutAbsoluteShutter_TheExposureIsFixed) {
  bus_.registers.set(0x51C, bus_.registers.get(0x51C) & ~kAbsoluteBit);
  const auto head = opened();
  EXPECT_EQ(head->limits().exposure_min, head->limits().exposure_max);
}

// The emulated camera changes in the third frame, and its pictures say so; the head believes the pictures.
TEST_F(IidcHeadTest, EmbeddedNumbers_AreTheSequenceAndTheSettingsAndAreNotInThePicture) {
  const auto head = streaming();
  ASSERT_TRUE(bus_.registers.embeds());
  bus_.lose(3);
  std::vector<std::uint32_t> numbers;
  for (int i = 0; i < 6; ++i) {
    const auto frame = next(*head);
    ASSERT_TRUE(frame) << frame.error().text();
    numbers.push_back(frame->sequence);
    const PlaneView& plane = frame->image.planes[0];
    for (int x = 0; x < plane.width; ++x) ASSERT_EQ(plane.data[x], static_cast<std::uint8_t>(frame->sequence)) << x;
    head->release(frame->slot);
  }
  EXPECT_EQ(numbers, (std::vector<std::uint32_t>{0, 1, 2, 4, 5, 6}));
}

TEST_F(IidcHeadTest, ACounterThatJumps_IsReportedAsItIs) {
  const auto head = streaming();
  pass_frames(*head, 2);
  bus_.jump_counter(1000);
  EXPECT_EQ(pass_frame(*head).sequence, 1002U);
}

TEST_F(IidcHeadTest, WithoutACounter_FramesThatFoundNoBufferAreCountedByTime) {
  bus_.registers.remove(0x12F8);
  request_.buffers = 2;
  const auto head = streaming();
  EXPECT_EQ(pass_frame(*head).sequence, 0U);
  bus_.lose(1);  // nobody can know of this one
  EXPECT_EQ(pass_frame(*head).sequence, 1U);
  const auto first = next(*head);
  const auto second = next(*head);
  ASSERT_TRUE(first && second);
  pass(period_ * 4);
  EXPECT_FALSE(*head->take_frame());
  head->release(second->slot);
  head->release(first->slot);
  EXPECT_EQ(pass_frame(*head).sequence - second->sequence, 5U);
  EXPECT_EQ(pass_frame(*head).sequence - second->sequence, 6U);
}

TEST_F(IidcHeadTest, AControlThatTakesLong_DelaysNoFrame) {
  const auto head = streaming();
  pass_frame(*head);
  std::promise<void> answer;
  std::shared_future<void> answered = answer.get_future().share();
  // Shared, because the worker still writes to the camera when this function has ended: the head stops then.
  const auto asked = std::make_shared<std::atomic<bool>>(false);
  bus_.before_write = [asked, answered](std::uint64_t, std::uint32_t) {
    *asked = true;
    answered.wait();
    return 0;
  };
  ASSERT_TRUE(head->set_exposure(Exposure::microseconds(1'000)));
  while (!*asked) std::this_thread::yield();
  for (int i = 0; i < 5; ++i) {
    clock_.advance(period_);
    const auto frame = head->take_frame();
    ASSERT_TRUE(frame && *frame) << i;
    head->release((*frame)->slot);
  }
  answer.set_value();
  EXPECT_EQ(pass_frames(*head, 5).in_effect.exposure, Exposure::microseconds(1'000));
}

}  // namespace
}  // namespace nodal::hal::iidc
