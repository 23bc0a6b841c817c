#include <poll.h>

#include "hal/linux/iidc/enumerator.h"
#include "hal/sim/clock.h"
#include "head_conformance.h"
#include "tests/support/iidc_bus.h"

namespace nodal::hal {

namespace {

/// Waits for opening, and for the jobs of the device's worker, before time advances.
class IidcWorld final : public HeadWorld, public HeadEnumerator {
 public:
  IidcWorld(const iidc::HeadRequest& request, const std::function<void(test::IidcBus&)>& adjust) : bus_(clock_) {
    adjust(bus_);
    trigger_.connect(0, &bus_);
    enumerator_.request(path(), request);
  }

  HeadEnumerator& enumerator() override { return *this; }
  Result<std::unique_ptr<HeadPort>> open(const std::string& path) override { return enumerator_.open_and_wait(path); }
  std::vector<HeadIdentity> list() override { return enumerator_.list(); }
  std::string path() override { return "iidc:00b09d0100c0ffee"; }
  ClockPort& clock() override { return clock_; }
  void pass(Duration time) override {
    enumerator_.settle();
    trigger_.step(clock_.now());
    clock_.advance(time);
    trigger_.step(clock_.now());
  }
  bool sleep(const WakeUps& wake_ups, Duration at_most) override {
    for (const Instant until = clock_.now() + at_most; clock_.now() < until; pass(Duration::microseconds(250))) {
      enumerator_.settle();
      for (const WakeUps::Descriptor& each : wake_ups.descriptors()) {
        pollfd reports{each.number, POLLIN, 0};
        if (each.number == test::IidcBus::kDescriptor ? bus_.readable() : ::poll(&reports, 1, 0) > 0) return true;
      }
      if (wake_ups.at() && *wake_ups.at() <= clock_.now()) return true;
    }
    return false;
  }
  TriggerPort* trigger() override { return &trigger_; }
  bool unplug() override {
    bus_.unplug();
    return true;
  }
  bool replug() override {
    bus_.plug_in();
    return true;
  }

 private:
  sim::SimClock clock_;
  test::IidcBus bus_;
  sim::SimTrigger trigger_{clock_, {}, 1};
  iidc::IidcEnumerator enumerator_{clock_, bus_};
};

HeadWorldKind kind(
    const std::string& name, PixelFormat pixels, const std::function<void(iidc::HeadRequest&)>& adjust,
    const std::function<void(test::IidcBus&)>& adjust_bus = [](test::IidcBus&) {}) {
  iidc::HeadRequest request;
  request.pixels = pixels;
  request.rate = {30, 1};
  request.readout = test::IidcBus::kReadout;
  adjust(request);
  return {name, [=] { return std::make_unique<IidcWorld>(request, adjust_bus); }};
}

/// Nothing of a mode, and only the shutter of the settings.
void make_plain(test::IidcBus& bus) {
  bus.usb.reset();
  bus.registers.remove(0x12F8);
  bus.registers.set(0x404, 0x0100'0000);
}

INSTANTIATE_TEST_SUITE_P(Iidc, HeadConformance,
                         testing::Values(kind("Grey", PixelFormat::kGrey8, [](iidc::HeadRequest&) {}),
                                         kind(
                                             "PlainYuv411", PixelFormat::kYuv411, [](iidc::HeadRequest&) {},
                                             make_plain),
                                         kind("MosaicOfFormat7", PixelFormat::kGrbg8,
                                              [](iidc::HeadRequest& request) {
                                                request.width = 48;
                                                request.height = 32;
                                                request.triggered = true;
                                                request.buffers = 2;
                                              })),
                         [](const auto& one) { return one.param.name; });

}  // namespace
}  // namespace nodal::hal
