#include <poll.h>

#include "hal/linux/v4l2/enumerator.h"
#include "hal/sim/clock.h"
#include "head_conformance.h"
#include "tests/support/v4l2_driver.h"

namespace nodal::hal {

namespace {

/// Waits for opening, and for the jobs of the device's worker, before time advances.
class V4l2World final : public HeadWorld, public HeadEnumerator {
 public:
  V4l2World(const v4l2::HeadRequest& request, const std::function<void(test::V4l2Driver&)>& adjust) : driver_(clock_) {
    adjust(driver_);
    enumerator_.request(path(), request);
  }

  HeadEnumerator& enumerator() override { return *this; }
  Result<std::unique_ptr<HeadPort>> open(const std::string& path) override { return enumerator_.open_and_wait(path); }
  std::vector<HeadIdentity> list() override { return enumerator_.list(); }
  std::string path() override { return "v4l2:usb-1.2"; }
  ClockPort& clock() override { return clock_; }
  void pass(Duration time) override {
    enumerator_.settle();
    clock_.advance(time);
  }
  bool sleep(const WakeUps& wake_ups, Duration at_most) override {
    for (const Instant until = clock_.now() + at_most; clock_.now() < until; pass(Duration::microseconds(250))) {
      enumerator_.settle();
      bool any = false;
      for (const WakeUps::Descriptor& each : wake_ups.descriptors()) {
        pollfd reports{each.number, POLLIN, 0};
        const bool woken = driver_.is_open(each.number) ? driver_.readable(each.number) : ::poll(&reports, 1, 0) > 0;
        if (each.ready != nullptr) *each.ready = woken;
        any |= woken;
      }
      if (any || (wake_ups.at() && *wake_ups.at() <= clock_.now())) return true;
    }
    return false;
  }
  bool unplug() override {
    driver_.unplug();
    return true;
  }
  bool replug() override {
    driver_.plug_in();
    return true;
  }

 private:
  sim::SimClock clock_;
  test::V4l2Driver driver_;
  v4l2::V4l2Enumerator enumerator_{clock_, driver_};
};

HeadWorldKind kind(const std::string& name, const v4l2::HeadRequest& request,
                   const std::function<void(test::V4l2Driver&)>& adjust) {
  return {name, [=] { return std::make_unique<V4l2World>(request, adjust); }};
}

v4l2::HeadRequest request(PixelFormat pixels, Fields fields, std::int32_t gain_step_mdb) {
  v4l2::HeadRequest request;
  request.pixels = pixels;
  request.fields = fields;
  request.gain_step_mdb = gain_step_mdb;
  return request;
}

INSTANTIATE_TEST_SUITE_P(
    V4l2, HeadConformance,
    testing::Values(kind("YuyvWithControls", request(PixelFormat::kYuyv, Fields::kProgressive, 100),
                         [](test::V4l2Driver& driver) {
                           driver.controls[V4L2_CID_EXPOSURE_AUTO] = {0, 3, 1, 3, 3};
                           driver.controls[V4L2_CID_EXPOSURE_ABSOLUTE] = {2, 300, 1, 100, 50};
                           driver.controls[V4L2_CID_GAIN] = {0, 255, 1, 32, 32};
                           driver.controls[V4L2_CID_RED_BALANCE] = {1, 8192, 1, 4096, 4096};
                           driver.controls[V4L2_CID_BLUE_BALANCE] = {1, 8192, 1, 4096, 4096};
                         }),
                    kind("InterlacedPlain", request(PixelFormat::kI420, Fields::kBottomFirst, 0),
                         [](test::V4l2Driver& driver) {
                           driver.field = V4L2_FIELD_INTERLACED;
                           driver.standard = V4L2_STD_NTSC;
                         }),
                    kind("AlternateFields", request(PixelFormat::kI420, Fields::kBottomFirst, 0),
                         [](test::V4l2Driver& driver) {
                           driver.field = V4L2_FIELD_ALTERNATE;
                           driver.standard = V4L2_STD_NTSC;
                           driver.height = 16;
                         }),
                    kind("SequentialFields", request(PixelFormat::kYuyv, Fields::kTopFirst, 0),
                         [](test::V4l2Driver& driver) { driver.field = V4L2_FIELD_SEQ_TB; }),
                    kind("Mjpeg", request(PixelFormat::kMjpeg, Fields::kProgressive, 0),
                         [](test::V4l2Driver& driver) { driver.formats = {V4L2_PIX_FMT_MJPEG}; }),
                    kind("MultiPlanarFewBuffers", request(PixelFormat::kI420, Fields::kProgressive, 0),
                         [](test::V4l2Driver& driver) {
                           driver.multiplanar = true;
                           driver.formats = {V4L2_PIX_FMT_YUV420M};
                           driver.most_buffers = 3;
                         })),
    [](const auto& one) { return one.param.name; });

}  // namespace
}  // namespace nodal::hal
