// A V4L2 head in virtual time, on a fake driver.
#pragma once

#include <gtest/gtest.h>

#include <functional>
#include <memory>
#include <string>
#include <utility>

#include "hal/linux/v4l2/enumerator.h"
#include "hal/sim/clock.h"
#include "tests/support/v4l2_driver.h"

namespace nodal::hal::v4l2 {

class V4l2HeadTest : public testing::Test {
 protected:
  V4l2HeadTest() { request_.pixels = PixelFormat::kYuyv; }

  Result<std::unique_ptr<HeadPort>> open(const std::string& path = "v4l2:usb-1.2") {
    if (!enumerator_) enumerator_ = std::make_unique<V4l2Enumerator>(clock_, driver_);
    enumerator_->request(path, request_);
    return enumerator_->open_and_wait(path);
  }
  std::unique_ptr<HeadPort> streaming() {
    auto head = open();
    if (!head) throw std::runtime_error(head.error().text());
    if (const Status started = (*head)->start(TriggerMode::kFreeRun); !started) {
      throw std::runtime_error(started.error().text());
    }
    return std::move(*head);
  }
  /// Clears the driver's hooks at the end of a scope, after the calls in progress.
  struct HookRemover {
    void operator()(V4l2HeadTest* test) const {
      if (test->enumerator_) test->enumerator_->settle();
      test->driver_.before = nullptr;
      test->driver_.after = nullptr;
    }
  };
  using Hook = std::unique_ptr<V4l2HeadTest, HookRemover>;
  /// Sets driver_.before or .after for a scope. Workers still close devices after a test's variables are destroyed, so
  /// a hook that refers to these variables must be removed earlier: declare it after them.
  [[nodiscard]] Hook before(std::function<int(unsigned long)> hook) {
    driver_.before = std::move(hook);
    return Hook(this);
  }
  [[nodiscard]] Hook after(std::function<void(unsigned long, void*)> hook) {
    driver_.after = std::move(hook);
    return Hook(this);
  }
  void pass(Duration time) {
    enumerator_->settle();
    clock_.advance(time);
  }
  /// The result of take_frame() once the next frame is there, or an earlier error.
  Result<FrameView> next(HeadPort& head) {
    for (int i = 0; i < 40; ++i) {
      auto frame = head.take_frame();
      if (!frame) return fail(frame.error());
      if (*frame) return **frame;
      pass(period_ / 4);
    }
    return fail(Errc::kTimeout, "no frame came in ten periods");
  }
  void expect_nothing_left() {
    enumerator_->settle();
    EXPECT_EQ(driver_.open_descriptors(), 0);
    EXPECT_EQ(driver_.mappings(), 0);
  }

  const Duration period_ = FrameRate{30000, 1001}.period();
  sim::SimClock clock_;
  test::V4l2Driver driver_{clock_};
  HeadRequest request_;
  std::unique_ptr<V4l2Enumerator> enumerator_;
};

inline void expect_error(const Status& status, Errc code, const std::string& says) {
  ASSERT_FALSE(status);
  EXPECT_EQ(status.error().code, code) << status.error().message;
  EXPECT_NE(status.error().message.find(says), std::string::npos) << status.error().message;
  EXPECT_NE(status.error().message.find("v4l2:"), std::string::npos) << "it names the head";
}
template <class T>
Status status_of(const Result<T>& result) {
  return result ? Status{} : fail(result.error());
}

}  // namespace nodal::hal::v4l2
