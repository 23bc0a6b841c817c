// The V4L2 head on uvcvideo and an emulated USB camera, with the tests that every head must pass.
#include "hal/linux/link/wait.h"
#include "tests/conformance/head_conformance.h"
#include "uvc_camera.h"
#include "vivid.h"

namespace nodal::hal {
namespace {

class UvcWorld final : public HeadWorld {
 public:
  UvcWorld() : camera_(std::make_unique<hil::UvcCamera>()) {
    v4l2::HeadRequest request;
    request.pixels = PixelFormat::kYuyv;
    request.rate = {30, 1};
    request.width = hil::UvcCamera::kWidth;
    request.height = hil::UvcCamera::kHeight;
    request.gain_step_mdb = 100;
    enumerator_.request(path(), request);
  }
  HeadEnumerator& enumerator() override { return enumerator_and_wait_; }
  std::string path() override { return "v4l2:usb-dummy_hcd.0-1"; }  // as list() names it
  ClockPort& clock() override { return clock_; }
  void pass(Duration time) override { hil::wait_for(time); }
  bool sleep(const WakeUps& wake_ups, Duration at_most) override {
    return wait_for(wake_ups, clock_.now(), at_most) || (wake_ups.at() && *wake_ups.at() <= clock_.now());
  }
  bool unplug() override {
    camera_->unplug();
    return true;
  }
  bool replug() override {
    camera_ = std::make_unique<hil::UvcCamera>();
    return true;
  }

 private:
  struct Waiting final : HeadEnumerator {
    explicit Waiting(v4l2::V4l2Enumerator& inner) : enumerator(inner) {}
    Result<std::unique_ptr<HeadPort>> open(const std::string& path) override { return enumerator.open_and_wait(path); }
    std::vector<HeadIdentity> list() override { return enumerator.list(); }
    v4l2::V4l2Enumerator& enumerator;
  };

  std::unique_ptr<hil::UvcCamera> camera_;
  linux_os::LinuxClock clock_;
  v4l2::V4l2Enumerator enumerator_{clock_};
  Waiting enumerator_and_wait_{enumerator_};
};

INSTANTIATE_TEST_SUITE_P(Uvc, HeadConformance,
                         testing::Values(HeadWorldKind{"usb", [] { return std::make_unique<UvcWorld>(); }}),
                         [](const auto& one) { return one.param.name; });

}  // namespace
}  // namespace nodal::hal
