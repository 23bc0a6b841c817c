// The V4L2 head on the kernel's own driver, with the tests that every head must pass.
#include "hal/linux/link/wait.h"
#include "tests/conformance/head_conformance.h"
#include "vivid.h"

namespace nodal::hal {
namespace {

class VividWorld final : public HeadWorld, public HeadEnumerator {
 public:
  VividWorld(int device, const v4l2::HeadRequest& request) : device_(device) { enumerator_.request(path(), request); }

  HeadEnumerator& enumerator() override { return *this; }
  Result<std::unique_ptr<HeadPort>> open(const std::string& path) override { return enumerator_.open_and_wait(path); }
  std::vector<HeadIdentity> list() override { return enumerator_.list(); }
  std::string path() override { return hil::vivid_path(device_); }
  ClockPort& clock() override { return clock_; }
  void pass(Duration time) override { hil::wait_for(time); }
  bool sleep(const WakeUps& wake_ups, Duration at_most) override {
    const Instant start = clock_.now();
    return wait_for(wake_ups, start, at_most) || (wake_ups.at() && *wake_ups.at() < start + at_most);
  }
  /// vivid reconnects when its last descriptor is closed.
  bool unplug() override {
    hil::set_vivid(device_, hil::kDisconnect, 1);
    return true;
  }

 private:
  const int device_;
  linux_os::LinuxClock clock_;
  v4l2::V4l2Enumerator enumerator_{clock_};
};

HeadWorldKind kind(const std::string& name, int device, const v4l2::HeadRequest& request) {
  return {name, [=] { return std::make_unique<VividWorld>(device, request); }};
}

v4l2::HeadRequest separate(v4l2::HeadRequest request) {
  request.separate_fields = true;
  return request;
}

INSTANTIATE_TEST_SUITE_P(Vivid, HeadConformance,
                         testing::Values(kind("NtscYuyv", 0, hil::ntsc(PixelFormat::kYuyv)),
                                         kind("NtscI420", 0, hil::ntsc(PixelFormat::kI420)),
                                         kind("NtscAlternate", 0, separate(hil::ntsc(PixelFormat::kYuyv))),
                                         kind("WebcamGrey", 0, hil::webcam(PixelFormat::kGrey8)),
                                         kind("WebcamI422", 0, hil::webcam(PixelFormat::kI422)),
                                         kind("WebcamNv12MultiPlanar", 1, hil::webcam(PixelFormat::kNv12))),
                         [](const auto& one) { return one.param.name; });

}  // namespace
}  // namespace nodal::hal
