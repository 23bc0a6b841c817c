#include "firmware/daemon/line_ports.h"

#include <algorithm>
#include <atomic>
#include <optional>
#include <utility>

namespace nodal::daemon {
namespace {

using firmware::GpioLine;
using firmware::RigConfig;
using firmware::SyncSource;
using hal::gpio::Bias;
using hal::gpio::LineName;

LineName name_of(const GpioLine& line) { return {line.chip, line.offset}; }

Bias bias_of(const GpioLine& line) {
  switch (line.pull) {
    case firmware::GpioPull::kNone: return Bias::kAsIs;
    case firmware::GpioPull::kUp: return Bias::kPullUp;
    case firmware::GpioPull::kDown: return Bias::kPullDown;
  }
  return Bias::kAsIs;
}

/// Nothing when the trigger has no line.
std::optional<hal::gpio::TriggerLines> trigger_lines(const RigConfig& config) {
  hal::gpio::TriggerLines lines;
  lines.active_high = config.trigger.active_high;
  if (config.trigger.source == SyncSource::kExternal) {
    if (!config.trigger.port) return std::nullopt;
    lines.input = name_of(*config.trigger.port);
    lines.input_bias = bias_of(*config.trigger.port);
    return lines;
  }
  // The first output is the one that readback is wired to.
  if (config.trigger.port) lines.outputs.emplace_back().line = name_of(*config.trigger.port);
  for (std::size_t i = 0; i < config.heads.size(); ++i) {
    const auto& own = config.heads[i].trigger;
    if (!own && !config.trigger.port) continue;
    const LineName name = name_of(own ? *own : *config.trigger.port);
    auto found = std::find_if(lines.outputs.begin(), lines.outputs.end(),
                              [&](const auto& output) { return output.line == name; });
    if (found == lines.outputs.end()) {
      lines.outputs.emplace_back().line = name;
      found = lines.outputs.end() - 1;
    }
    found->heads.push_back(static_cast<HeadIndex>(i));
  }
  if (lines.outputs.empty()) return std::nullopt;
  if (config.trigger.readback) lines.read_back = name_of(*config.trigger.readback);
  return lines;
}

struct Output {
  const char* key;
  LineName line;
  bool safe_level;
};

std::vector<Output> outputs_of(const RigConfig& config) {
  std::vector<Output> all;
  if (const auto trigger = trigger_lines(config)) {
    for (const auto& output : trigger->outputs) all.push_back({"trigger", output.line, !trigger->active_high});
  }
  const auto add_lamp = [&](const char* key, const std::optional<GpioLine>& line) {
    if (line) all.push_back({key, name_of(*line), line->low});
  };
  add_lamp("panel.status", config.panel.status_line);
  add_lamp("panel.tally", config.panel.tally_line);
  return all;
}

/// A trigger whose lines could not be claimed.
class MissingTrigger final : public hal::TriggerPort {
 public:
  explicit MissingTrigger(Error why) : why_(std::move(why)) {}
  Status start(const hal::TriggerSettings&) override {
    if (safe_.load()) return fail(Errc::kDeviceGone, why_.message);
    return fail(why_);
  }
  void stop() override {}
  Result<std::optional<hal::TriggerEdge>> take_edge() override { return fail(Errc::kDeviceGone, why_.message); }
  void add_wake_ups(hal::WakeUps&) const override {}
  void make_safe() noexcept override { safe_.store(true); }

 private:
  const Error why_;
  std::atomic<bool> safe_{false};
};

std::string sentence(const Output& output) {
  return std::string(output.key) + ": " + output.line.text() + " is at its safe level, " +
         (output.safe_level ? "high" : "low");
}

}  // namespace

LinePorts::LinePorts(const RigConfig& config, hal::gpio::System& system) : system_(system), pins_(system) {
  claim_trigger(config);
  claim_pins(config.panel);
}

void LinePorts::claim_trigger(const RigConfig& config) {
  auto lines = trigger_lines(config);
  if (!lines) return;
  auto opened = hal::gpio::GpioTrigger::open(system_, std::move(*lines));
  if (!opened) {
    problems_.push_back(opened.error());
    trigger_ = std::make_unique<MissingTrigger>(opened.error());
    return;
  }
  notice_ = (*opened)->notice();
  trigger_ = std::move(*opened);
}

void LinePorts::claim_pins(const firmware::PanelConfig& config) {
  const auto note = [&](const char* key, const Error& error) { problems_.push_back(error.in(key)); };
  if (config.button_line) {
    const GpioLine& line = *config.button_line;
    const auto pin = pins_.add_input({name_of(line), line.low, bias_of(line)});
    if (pin) panel_.button = *pin;
    else note("panel.button", pin.error());
  }
  const auto add_lamp = [&](const char* key, const std::optional<GpioLine>& line, hal::OutputPinPort*& into) {
    if (!line) return;
    const auto pin = pins_.add_output({name_of(*line), line->low, Bias::kAsIs});
    if (pin) into = *pin;
    else note(key, pin.error());
  };
  add_lamp("panel.status", config.status_line, panel_.status);
  add_lamp("panel.tally", config.tally_line, panel_.tally);
  if (const Status running = pins_.start(); !running) {
    note("panel", running.error());
    panel_ = {};
  }
}

hal::TriggerPort* LinePorts::trigger() { return trigger_.get(); }

void LinePorts::add_to(firmware::PanelPins& pins) const {
  if (panel_.button != nullptr) pins.button = panel_.button;
  if (panel_.status != nullptr) pins.status = panel_.status;
  if (panel_.tally != nullptr) pins.tally = panel_.tally;
}

void LinePorts::make_safe() noexcept {
  if (trigger_) trigger_->make_safe();
  pins_.make_safe();
}

SafeLevels set_safe_levels(const RigConfig& config, hal::gpio::System& system) {
  SafeLevels done;
  for (const Output& output : outputs_of(config)) {
    const auto claimed = hal::gpio::claim_output(system, output.line, output.safe_level);
    if (claimed) done.lines.push_back(sentence(output));
    else done.problems.push_back(claimed.error().in(output.key));
  }
  return done;
}

}  // namespace nodal::daemon
