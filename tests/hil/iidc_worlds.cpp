// The IIDC head on libdc1394, libusb and an emulated camera, with the tests that every head must pass.
#include "hal/linux/link/wait.h"
#include "iidc_camera.h"
#include "tests/conformance/head_conformance.h"
#include "vivid.h"

namespace nodal::hal {
namespace {

class IidcUsbWorld final : public HeadWorld, public HeadEnumerator {
 public:
  IidcUsbWorld() : camera_(std::make_unique<hil::IidcCamera>()) {
    cameras_.request(path(), hil::IidcCamera::request());
  }
  HeadEnumerator& enumerator() override { return *this; }
  Result<std::unique_ptr<HeadPort>> open(const std::string& path) override { return cameras_.open_and_wait(path); }
  std::vector<HeadIdentity> list() override { return cameras_.list(); }
  std::string path() override { return hil::IidcCamera::kPath; }
  ClockPort& clock() override { return clock_; }
  void pass(Duration time) override { hil::wait_for(time); }
  bool sleep(const WakeUps& wake_ups, Duration at_most) override {
    const bool woken = wait_for(wake_ups, clock_.now(), at_most);
    return woken || (wake_ups.at() && *wake_ups.at() <= clock_.now());
  }
  bool unplug() override {
    camera_->unplug();
    return true;
  }
  bool replug() override {
    camera_ = std::make_unique<hil::IidcCamera>();
    return true;
  }

 private:
  std::unique_ptr<hil::IidcCamera> camera_;
  linux_os::LinuxClock clock_;
  iidc::IidcEnumerator cameras_{clock_};
};

INSTANTIATE_TEST_SUITE_P(Iidc, HeadConformance,
                         testing::Values(HeadWorldKind{"usb", [] { return std::make_unique<IidcUsbWorld>(); }}),
                         [](const auto& one) { return one.param.name; });

}  // namespace
}  // namespace nodal::hal
