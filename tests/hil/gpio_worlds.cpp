// The trigger and the pins on the kernel's gpio-sim, with the tests that every implementation must pass.
#include <stdexcept>

#include "gpio_sim.h"
#include "hal/linux/gpio/pins.h"
#include "hal/linux/gpio/trigger.h"
#include "tests/conformance/pin_conformance.h"
#include "tests/conformance/trigger_conformance.h"

namespace nodal::hal {
namespace {

/// The ports' threads run independently: the effect of a call appears a little later.
constexpr Duration kSettle = Duration::milliseconds(1);

class SimChipPins final : public PinWorld {
 public:
  explicit SimChipPins(bool active_low) : active_low_(active_low) {
    output_ = pins_.add_output({chip_.line(4), active_low, gpio::Bias::kAsIs}).value();
    input_ = pins_.add_input({chip_.line(5), false, gpio::Bias::kAsIs}).value();
    if (!pins_.start()) throw std::runtime_error("no thread");
  }
  OutputPinPort& output() override { return *output_; }
  bool safe_level() const override { return false; }
  bool output_wire() override {
    hil::wait_for(kSettle);
    return chip_.wire(4) != active_low_;
  }
  InputPinPort& input() override { return *input_; }
  void drive_input(bool high) override { chip_.drive(5, high); }
  Instant now() override { return gpio::kernel().now(); }
  void pass(Duration time) override { hil::wait_for(time); }

 private:
  const bool active_low_;
  hil::SimChip chip_{"pins", 8};
  gpio::Pins pins_{gpio::kernel()};
  gpio::GpioOutputPin* output_ = nullptr;
  gpio::GpioInputPin* input_ = nullptr;
};

class SimChipTrigger final : public TriggerWorld {
 public:
  SimChipTrigger() {
    gpio::TriggerLines lines;
    lines.outputs.emplace_back().line = chip_.line(3);
    lines.outputs.back().heads = {0, 1};
    auto opened = gpio::GpioTrigger::open(gpio::kernel(), lines);
    if (!opened) throw std::runtime_error(opened.error().text());
    trigger_ = std::move(*opened);
  }
  TriggerPort& trigger() override { return *trigger_; }
  void pass(Duration time) override { hil::wait_for(time); }
  Duration longest_pause() const override { return Duration::milliseconds(200); }
  Duration jitter() const override { return Duration::microseconds(100); }

 private:
  hil::SimChip chip_{"trigger", 8};
  std::unique_ptr<gpio::GpioTrigger> trigger_;
};

INSTANTIATE_TEST_SUITE_P(GpioSim, PinConformance,
                         testing::Values(PinWorldKind{"Active", [] { return std::make_unique<SimChipPins>(false); }},
                                         PinWorldKind{"ActiveLow", [] { return std::make_unique<SimChipPins>(true); }}),
                         [](const auto& kind) { return kind.param.name; });

INSTANTIATE_TEST_SUITE_P(GpioSim, TriggerConformance,
                         testing::Values(TriggerWorldKind{"Pulses", [] { return std::make_unique<SimChipTrigger>(); }}),
                         [](const auto& kind) { return kind.param.name; });

}  // namespace
}  // namespace nodal::hal
