// The video modes of an IIDC head: what is in the camera's registers, and what is refused.
#include "head_fixture.h"

namespace nodal::hal::iidc {
namespace {

TEST_F(IidcHeadTest, AFixedMode_IsInItsRegistersAndTheOldStreamHasEnded) {
  ASSERT_TRUE(bus_.transmits());
  request_.pixels = PixelFormat::kUyvy;
  request_.rate = {15, 1};
  const auto head = opened();
  EXPECT_FALSE(bus_.transmits());
  EXPECT_EQ(bus_.registers.get(0x608) >> 29, 0U);
  EXPECT_EQ(bus_.registers.get(0x604) >> 29, 3U);
  EXPECT_EQ(bus_.registers.get(0x600) >> 29, 3U);
  EXPECT_EQ(bus_.registers.get(0x610), 0x8000'0000U) << "it is switched on";
  EXPECT_EQ(head->format().width, 640);
  EXPECT_EQ(head->format().height, 480);
  EXPECT_EQ(head->identity().serial, "00b09d0100c0ffee");
  EXPECT_EQ(head->identity().model, "Maker Model");
}

TEST_F(IidcHeadTest, OnIeee1394_TheSpeedIs400AndTheChannelStays) {
  bus_.usb.reset();
  opened();
  EXPECT_EQ(bus_.registers.get(0x60C), 0x3200'0000U);
}

TEST_F(IidcHeadTest, TheGuid_IsReadWithAndWithout0xAndNothingElseIsACamera) {
  EXPECT_TRUE(open("iidc:0xb09d0100c0ffee"));
  for (const char* const path : {"iidc:", "iidc:front", "iidc:00b09d0100c0ffee0000000", "iidc:00b09d0100c0ffef"}) {
    const auto head = open(path);
    ASSERT_FALSE(head) << path;
    EXPECT_EQ(head.error().code, Errc::kNoSuchDevice);
    EXPECT_NE(head.error().message.find("there is: iidc:00b09d0100c0ffee"), std::string::npos) << head.error().message;
  }
}

TEST_F(IidcHeadTest, APartOfTheSensor_IsInTheMiddleWithTheSmallestPacketThatReachesTheRate) {
  request_.pixels = PixelFormat::kGrbg8;
  request_.width = 48;
  request_.height = 32;
  const auto head = opened();
  std::uint32_t value = 0;
  const auto at = [&](std::uint32_t offset) {
    EXPECT_TRUE(bus_.registers.read(Registers::kFormat7 + offset, value));
    return value;
  };
  EXPECT_EQ(bus_.registers.get(0x608) >> 29, 7U);
  EXPECT_EQ(at(0x0C), 48U << 16 | 32);
  EXPECT_EQ(at(0x08), 24U << 16 | 16);
  EXPECT_EQ(at(0x10) >> 24, 9U) << "RAW8";
  EXPECT_EQ(at(0x44) >> 16, 8U) << "48 * 32 * 30 / 8000 = 5.76 bytes, in units of 4";
  EXPECT_FLOAT_EQ(bus_.registers.absolute(Registers::kFrameRate), 30);
  EXPECT_EQ(head->format().pixels, PixelFormat::kGrbg8);
}

TEST_F(IidcHeadTest, APlaceAndAPacketSize_AreThoseRequested) {
  request_.width = 48;
  request_.height = 32;
  request_.left = 2;
  request_.top = 30;
  request_.packet_bytes = 64;
  opened();
  std::uint32_t place = 0, packet = 0;
  bus_.registers.read(Registers::kFormat7 + 0x08, place);
  bus_.registers.read(Registers::kFormat7 + 0x44, packet);
  EXPECT_EQ(place, 2U << 16 | 30);
  EXPECT_EQ(packet >> 16, 64U);
}

TEST_F(IidcHeadTest, WhatTheCameraDoesNotHave_IsRefusedWithWhatItHas) {
  struct Case {
    std::function<void(HeadRequest&)> change;
    const char* says;
  };
  for (const Case& one : {
           Case{[](HeadRequest& r) { r.pixels = PixelFormat::kRgb24; }, "GRBG8, GREY, UYVY, YUV411"},
           Case{[](HeadRequest& r) {
                  r.rate = {24, 1}, r.pixels = PixelFormat::kUyvy;
                },
                "640x480 at 15/2 15 30"},
           Case{[](HeadRequest& r) { r.width = 50, r.height = 32; }, "multiples of 8x2"},
           Case{[](HeadRequest& r) { r.width = 48, r.height = 32, r.left = 3, r.top = 0; }, "multiples of 2 and 2"},
           Case{[](HeadRequest& r) { r.width = 48, r.height = 32, r.left = 50, r.top = 0; }, "not inside its 96x64"},
           Case{[](HeadRequest& r) {
                  r.width = 96, r.height = 64, r.rate = {1000, 1};
                },
                "at most 512 bytes"},
           Case{[](HeadRequest& r) { r.width = 96, r.height = 64, r.packet_bytes = 6; }, "a multiple of 4"},
           Case{[](HeadRequest& r) { r.width = 96, r.height = 64, r.packet_bytes = 8; }, "10.416667 frames a second"},
       }) {
    HeadRequest request = request_;
    one.change(request);
    std::swap(request, request_);
    expect_says(refusal(), Errc::kUnsupported, one.says);
    std::swap(request, request_);
  }
}

TEST_F(IidcHeadTest, AModeThatTheCameraDeclaresWrong_IsRefused) {
  bus_.registers.set(0x628, 0x8000'0000);
  expect_says(refusal(), Errc::kUnsupported, "refuses this combination");
}

TEST_F(IidcHeadTest, ASettingOfFormat7ThatTheCameraDeclaresWrong_IsRefused) {
  request_.width = 48;
  request_.height = 32;
  bus_.registers.refuse_format7(0x0080'0000);
  expect_says(refusal(), Errc::kUnsupported, "setting the size of its picture: the camera refuses it");
  bus_.registers.refuse_format7(0x0040'0000);
  expect_says(refusal(), Errc::kUnsupported, "setting the size of its packets: the camera refuses it");
}

TEST_F(IidcHeadTest, ASlowBus_IsRefusedWithTheNumbers) {
  bus_.usb = device::UsbPlace{3, 12, 12, ""};
  expect_says(refusal(), Errc::kBandwidth, "9.2 MB/s");
}

}  // namespace
}  // namespace nodal::hal::iidc
