// A V4L2 head's requests to its device, and its handling of the answers.
#include <gtest/gtest.h>
#include <linux/videodev2.h>

#include <atomic>
#include <latch>
#include <set>

#include "hal/linux/v4l2/head.h"
#include "head_fixture.h"

namespace nodal::hal::v4l2 {
namespace {

TEST_F(V4l2HeadTest, NodeBusOrCard_EachOpensTheDevice) {
  for (const char* const path : {"v4l2:/dev/video7", "v4l2:usb-1.2", "v4l2:Camera"}) {
    const auto head = open(path);
    ASSERT_TRUE(head) << head.error().message;
    EXPECT_EQ((*head)->identity().path, path);
    EXPECT_EQ((*head)->identity().model, "Camera");
  }
  expect_nothing_left();
}

TEST_F(V4l2HeadTest, NoSuchDevice_TheErrorNamesThoseThatAreThere) {
  expect_error(status_of(open("v4l2:/dev/video3")), Errc::kNoSuchDevice, "v4l2:usb-1.2 (Camera)");
  expect_error(status_of(open("v4l2:usb-9")), Errc::kNoSuchDevice, "v4l2:usb-1.2 (Camera)");
  expect_nothing_left();
}

TEST_F(V4l2HeadTest, WhatTheDeviceDoesNotHave_IsRefusedWithWhatItHas) {
  const HeadRequest good = request_;
  request_.pixels = PixelFormat::kRgb24;
  expect_error(status_of(open()), Errc::kUnsupported, "YUYV, YU12, GREY");
  request_ = good;
  request_.width = 640;
  request_.height = 480;
  expect_error(status_of(open()), Errc::kUnsupported, "48x32");
  request_ = good;
  request_.rate = {25, 1};
  expect_error(status_of(open()), Errc::kUnsupported, "30000/1001");
  request_ = good;
  request_.input = "Composite";
  expect_error(status_of(open()), Errc::kUnsupported, "0 \"S-Video\"");
  request_ = good;
  request_.standard = "NTSC-4";
  expect_error(status_of(open()), Errc::kUnsupported, "NTSC-M");
  request_ = good;
  request_.fields = Fields::kTopFirst;
  expect_error(status_of(open()), Errc::kUnsupported, "fields = \"progressive\"");
  expect_nothing_left();
}

TEST_F(V4l2HeadTest, Opened_AutomaticModesAreOff) {
  driver_.controls[V4L2_CID_EXPOSURE_AUTO] = {0, 3, 1, 3, 3};
  driver_.controls[V4L2_CID_EXPOSURE_AUTO_PRIORITY] = {0, 1, 1, 0, 1};
  driver_.controls[V4L2_CID_AUTOGAIN] = {0, 1, 1, 1, 1};
  driver_.controls[V4L2_CID_AUTO_WHITE_BALANCE] = {0, 1, 1, 1, 1};
  const auto head = open();
  ASSERT_TRUE(head);
  EXPECT_EQ(driver_.control(V4L2_CID_EXPOSURE_AUTO), V4L2_EXPOSURE_MANUAL);
  EXPECT_EQ(driver_.control(V4L2_CID_EXPOSURE_AUTO_PRIORITY), 0);
  EXPECT_EQ(driver_.control(V4L2_CID_AUTOGAIN), 0);
  EXPECT_EQ(driver_.control(V4L2_CID_AUTO_WHITE_BALANCE), 0);
}

TEST_F(V4l2HeadTest, ExposureAndGain_ReachTheDeviceInItsUnitsAndComeBackAsItHasThem) {
  driver_.controls[V4L2_CID_EXPOSURE_ABSOLUTE] = {1, 300, 1, 100, 50};
  driver_.controls[V4L2_CID_GAIN] = {0, 96, 2, 0, 0};
  request_.gain_step_mdb = 250;
  const auto head = streaming();
  EXPECT_EQ(head->limits().exposure_min, Exposure::microseconds(100));
  EXPECT_EQ(head->limits().exposure_max, Exposure::microseconds(30'000));
  EXPECT_EQ(head->limits().gain_max, Gain::millidecibels(24'000));
  ASSERT_TRUE(head->set_exposure(Exposure::microseconds(8'349)));
  ASSERT_TRUE(head->set_gain(Gain::millidecibels(6'020)));
  FrameView frame;
  for (int i = 0; i < 6; ++i) {
    const auto taken = next(*head);
    ASSERT_TRUE(taken);
    frame = *taken;
    head->release(frame.slot);
  }
  EXPECT_EQ(driver_.control(V4L2_CID_EXPOSURE_ABSOLUTE), 83);  // the unit is 100 us
  EXPECT_EQ(driver_.control(V4L2_CID_GAIN), 24);               // the unit is 250 mdB, in steps of 2
  EXPECT_EQ(frame.in_effect.exposure, Exposure::microseconds(8'300));
  EXPECT_EQ(frame.in_effect.gain, Gain::millidecibels(6'000));
}

TEST_F(V4l2HeadTest, AThreadThatSleepsByPoll_AsksTheDriverOnceAFrameAndInEveryEighthStepInBetween) {
  int asked = 0;
  const auto hook = before([&](unsigned long request) {
    asked += request == VIDIOC_DQBUF;
    return 0;
  });
  const auto head = streaming();
  const auto sleep = [&](bool ready) {
    WakeUps wake_ups;
    head->add_wake_ups(wake_ups);
    for (const WakeUps::Descriptor& each : wake_ups.descriptors()) {
      if (each.ready != nullptr) *each.ready = ready;
    }
  };
  const auto taken_in = [&](int steps) {
    int frames = 0;
    for (int i = 0; i < steps; ++i) {
      const auto frame = head->take_frame();
      EXPECT_TRUE(frame);
      if (!frame || !*frame) continue;
      head->release((*frame)->slot);
      ++frames;
    }
    return frames;
  };
  const auto first = next(*head);
  ASSERT_TRUE(first);
  head->release(first->slot);
  clock_.advance(first->received + Duration::milliseconds(1) + period_ -
                 clock_.now());  // frames are taken at an age of 1 ms
  ASSERT_EQ(taken_in(1), 1);
  for (int i = 0; i < 5; ++i) {
    asked = 0;
    sleep(false);  // woken for another head
    EXPECT_EQ(taken_in(3), 0);
    clock_.advance(period_);
    sleep(true);
    EXPECT_EQ(taken_in(7), 1);
    EXPECT_EQ(asked, 1);
  }
  clock_.advance(period_);
  EXPECT_EQ(taken_in(8), 1) << "a thread that is too busy to sleep gets its frames, too";
  clock_.advance(period_ * 3);
  sleep(true);
  EXPECT_EQ(taken_in(3), 3) << "after a pause the frames that wait are taken at once";
}

// If take_frame() set the control itself, this test would deadlock.
TEST_F(V4l2HeadTest, AControlThatTakesForever_FramesGoOnAndCarryTheOldValueUntilItIsDone) {
  driver_.controls[V4L2_CID_EXPOSURE_ABSOLUTE] = {1, 300, 1, 100, 50};
  std::latch answered(1);
  std::atomic<bool> slow{false};
  const auto hook = before([&](unsigned long request) {
    if (request == VIDIOC_S_CTRL && slow.load()) answered.wait();
    return 0;
  });
  const auto head = streaming();
  ASSERT_TRUE(next(*head));
  slow.store(true);
  ASSERT_TRUE(head->set_exposure(Exposure::microseconds(20'000)));
  for (int i = 0; i < 20; ++i) {
    clock_.advance(period_);
    const auto frame = head->take_frame();
    ASSERT_TRUE(frame);
    ASSERT_TRUE(*frame) << i;
    EXPECT_EQ((*frame)->in_effect.exposure, Exposure::microseconds(5'000));
    head->release((*frame)->slot);
  }
  answered.count_down();
  auto frame = next(*head);
  for (int i = 0; i < 6 && frame; ++i) {
    head->release(frame->slot);
    frame = next(*head);
  }
  ASSERT_TRUE(frame);
  EXPECT_EQ(frame->in_effect.exposure, Exposure::microseconds(20'000));
}

TEST_F(V4l2HeadTest, TheDriverGrantsMoreOrFewerBuffers_AsManyFramesAreLentAndOutOfOrderReturnsWork) {
  for (const std::uint32_t granted : {2U, 5U, 31U}) {
    driver_.fewest_buffers = driver_.most_buffers = granted;
    const auto head = streaming();
    for (int round = 0; round < 3; ++round) {
      std::vector<BufferSlot> lent;
      std::set<BufferSlot> distinct;
      for (std::uint32_t i = 0; i < granted; ++i) {
        const auto frame = next(*head);
        ASSERT_TRUE(frame) << frame.error().message;
        lent.push_back(frame->slot);
        distinct.insert(frame->slot);
      }
      EXPECT_EQ(distinct.size(), granted);
      for (std::size_t i = lent.size(); i-- > 0;) head->release(lent[i]);
    }
  }
}

}  // namespace
}  // namespace nodal::hal::v4l2
