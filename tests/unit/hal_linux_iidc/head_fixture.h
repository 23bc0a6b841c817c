// An IIDC head in virtual time, on an emulated camera.
#pragma once

#include <gtest/gtest.h>

#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#include "hal/linux/iidc/enumerator.h"
#include "hal/sim/clock.h"
#include "tests/support/iidc_bus.h"

namespace nodal::hal::iidc {

// Bits of features' registers in IIDC 1.31: on, automatic (of the trigger: active high), absolute.
inline constexpr std::uint32_t kOnBit = 0x0200'0000, kAutoBit = 0x0100'0000, kHighBit = 0x0100'0000;
inline constexpr std::uint32_t kAbsoluteBit = 0x4000'0000;

class IidcHeadTest : public testing::Test {
 protected:
  using Registers = test::IidcRegisters;
  static constexpr const char* kPath = "iidc:00b09d0100c0ffee";

  IidcHeadTest() {
    request_.rate = {30, 1};
    request_.pixels = PixelFormat::kGrey8;
    request_.readout = test::IidcBus::kReadout;
  }
  ~IidcHeadTest() override {
    if (enumerator_) enumerator_->settle();
    bus_.before_read = nullptr;
    bus_.before_write = nullptr;
  }

  Result<std::unique_ptr<HeadPort>> open(const std::string& path = kPath) {
    if (!enumerator_) enumerator_ = std::make_unique<IidcEnumerator>(clock_, bus_);
    enumerator_->request(path, request_);
    return enumerator_->open_and_wait(path);
  }
  std::unique_ptr<HeadPort> opened() {
    auto head = open();
    if (!head) throw std::runtime_error(head.error().text());
    return std::move(*head);
  }
  std::unique_ptr<HeadPort> streaming(TriggerMode mode = TriggerMode::kFreeRun) {
    auto head = opened();
    const Status started = head->start(mode);
    if (!started) throw std::runtime_error(started.error().text());
    enumerator_->settle();
    return head;
  }
  Error refusal() {
    const auto head = open();
    return head ? Error{Errc::kInternal, "it was opened"} : head.error();
  }
  /// Time in which the worker does all that was posted first.
  void pass(Duration time) {
    enumerator_->settle();
    trigger_.step(clock_.now());
    clock_.advance(time);
    trigger_.step(clock_.now());
  }
  /// What take_frame() says first that is not "nothing yet", within 12 periods.
  Result<FrameView> next(HeadPort& head) {
    for (const Instant until = clock_.now() + period_ * 12; clock_.now() < until; pass(period_ / 3)) {
      auto taken = head.take_frame();
      if (!taken) return fail(taken.error());
      if (taken->has_value()) return **taken;
    }
    return fail(Errc::kTimeout, "no frame came");
  }
  /// The next frame, returned at once. Throws the head's error.
  FrameView pass_frame(HeadPort& head) {
    const auto frame = next(head);
    if (!frame) throw std::runtime_error(frame.error().text());
    head.release(frame->slot);
    return *frame;
  }
  FrameView pass_frames(HeadPort& head, int count) {
    FrameView last;
    for (int i = 0; i < count; ++i) last = pass_frame(head);
    return last;
  }

  const Duration period_ = FrameRate{30, 1}.period();
  sim::SimClock clock_;
  test::IidcBus bus_{clock_};
  sim::SimTrigger trigger_{clock_, {}, 1};
  HeadRequest request_;
  std::unique_ptr<IidcEnumerator> enumerator_;
};

inline void expect_says(const Error& error, Errc code, const std::string& says) {
  EXPECT_EQ(error.code, code) << error.message;
  EXPECT_NE(error.message.find(says), std::string::npos) << error.message;
  EXPECT_NE(error.message.find("'iidc:00b09d0100c0ffee"), std::string::npos) << "it names the head: " << error.message;
}

}  // namespace nodal::hal::iidc
