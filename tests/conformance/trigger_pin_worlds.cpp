// Triggers and pins that need no hardware, with the tests that every implementation must pass.
#include <algorithm>
#include <stdexcept>

#include "hal/linux/gpio/pins.h"
#include "hal/linux/gpio/trigger.h"
#include "hal/replay/deck.h"
#include "hal/sim/clock.h"
#include "hal/sim/pin.h"
#include "hal/sim/trigger.h"
#include "pin_conformance.h"
#include "tests/support/gpio_chips.h"
#include "trigger_conformance.h"

namespace nodal::hal {

namespace {

class SimPinWorld final : public PinWorld {
 public:
  explicit SimPinWorld(bool safe) : safe_(safe), output_(safe) {}
  OutputPinPort& output() override { return output_; }
  bool safe_level() const override { return safe_; }
  bool output_wire() override { return output_.level_at(clock_.now()); }
  InputPinPort& input() override { return input_; }
  void drive_input(bool high) override { input_.script(clock_.now(), high); }
  Instant now() override { return clock_.now(); }
  void pass(Duration time) override { clock_.advance(time); }

 private:
  const bool safe_;
  sim::SimClock clock_;
  sim::SimOutputPin output_;
  sim::SimInputPin input_{clock_};
};

/// The lamps and the button of nodald on fake GPIO chips in virtual time. Off is the safe level; for a lamp that is on
/// when its line is low, the wire is read inverted.
class GpioPinWorld final : public PinWorld {
 public:
  explicit GpioPinWorld(bool active_low) : active_low_(active_low) {
    chips_.add("gpiochip0", "main", 32);
    output_ = pins_.add_output({{"gpiochip0", 4}, active_low, gpio::Bias::kAsIs}).value();
    input_ = pins_.add_input({{"gpiochip0", 5}, false, gpio::Bias::kAsIs}).value();
    if (!pins_.start()) throw std::runtime_error("no thread");
  }
  OutputPinPort& output() override { return *output_; }
  bool safe_level() const override { return false; }
  bool output_wire() override { return chips_.wire({"gpiochip0", 4}) != active_low_; }
  InputPinPort& input() override { return *input_; }
  void drive_input(bool high) override { chips_.drive({"gpiochip0", 5}, high); }
  Instant now() override { return chips_.now(); }
  void pass(Duration time) override { chips_.pass(time); }

 private:
  const bool active_low_;
  test::GpioChips chips_;
  gpio::Pins pins_{chips_};
  gpio::GpioOutputPin* output_ = nullptr;
  gpio::GpioInputPin* input_ = nullptr;
};

INSTANTIATE_TEST_SUITE_P(
    All, PinConformance,
    testing::Values(PinWorldKind{"SimSafeLow", [] { return std::make_unique<SimPinWorld>(false); }},
                    PinWorldKind{"SimSafeHigh", [] { return std::make_unique<SimPinWorld>(true); }},
                    PinWorldKind{"Gpio", [] { return std::make_unique<GpioPinWorld>(false); }},
                    PinWorldKind{"GpioActiveLow", [] { return std::make_unique<GpioPinWorld>(true); }}),
    [](const auto& kind) { return kind.param.name; });

class SimTriggerWorld final : public TriggerWorld {
 public:
  explicit SimTriggerWorld(Duration jitter) : jitter_(jitter), trigger_(clock_, options(jitter), 5) {}
  TriggerPort& trigger() override { return trigger_; }
  void pass(Duration time) override { clock_.advance(time); }
  Duration jitter() const override { return jitter_; }

 private:
  static sim::TriggerOptions options(Duration jitter) {
    sim::TriggerOptions options;
    options.jitter = jitter;
    return options;
  }
  const Duration jitter_;
  sim::SimClock clock_;
  sim::SimTrigger trigger_;
};

class ReplayTriggerWorld final : public TriggerWorld {
 public:
  TriggerPort& trigger() override { return deck_.trigger(); }
  void pass(Duration time) override { clock_.advance(time); }

 private:
  sim::SimClock clock_;
  replay::Deck deck_{clock_, {}};
};

/// The two kinds of TriggerPort on GPIO lines: pulses sent by the port's thread, with or without a line that reads them
/// back. A pause is a suspended board: its threads run again 10 ms before the pause ends.
class GpioTriggerWorld final : public TriggerWorld {
 public:
  explicit GpioTriggerWorld(bool read_back) {
    chips_.add("gpiochip0", "main", 32);
    gpio::TriggerLines lines;
    lines.outputs.emplace_back().line = {"gpiochip0", 17};
    lines.outputs.back().heads = {0, 1, 2};
    if (read_back) {
      lines.read_back = gpio::LineName{"gpiochip0", 27};
      chips_.connect({"gpiochip0", 17}, {"gpiochip0", 27});
    }
    trigger_ = gpio::GpioTrigger::open(chips_, lines).value();
  }
  TriggerPort& trigger() override { return *trigger_; }
  void pass(Duration time) override {
    constexpr Duration kAwake = Duration::milliseconds(10);
    const bool suspended = time > Duration::seconds(86'400);
    if (suspended) chips_.suspend(time - kAwake);
    chips_.pass(suspended ? kAwake : time);
  }

 private:
  test::GpioChips chips_;
  std::unique_ptr<gpio::GpioTrigger> trigger_;
};

INSTANTIATE_TEST_SUITE_P(
    All, TriggerConformance,
    testing::Values(TriggerWorldKind{"Sim", [] { return std::make_unique<SimTriggerWorld>(Duration{}); }},
                    TriggerWorldKind{"SimJitter",
                                     [] { return std::make_unique<SimTriggerWorld>(Duration::microseconds(50)); }},
                    TriggerWorldKind{"Gpio", [] { return std::make_unique<GpioTriggerWorld>(false); }},
                    TriggerWorldKind{"GpioReadBack", [] { return std::make_unique<GpioTriggerWorld>(true); }},
                    TriggerWorldKind{"Replay", [] { return std::make_unique<ReplayTriggerWorld>(); }}),
    [](const auto& kind) { return kind.param.name; });

}  // namespace
}  // namespace nodal::hal
