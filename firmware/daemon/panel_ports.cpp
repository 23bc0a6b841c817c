#include "firmware/daemon/panel_ports.h"

#include <charconv>
#include <string_view>

namespace nodal::daemon {
namespace {

constexpr std::string_view kSim = "sim:";
constexpr std::string_view kHow =
    "must be sim:TIME+LENGTH,... in seconds after the start, one after the other, as in \"sim:2+0.2,8+2\"";

/// Reads seconds at the front of `text` and removes them from it.
std::optional<Duration> take_seconds(std::string_view& text) {
  double seconds = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), seconds);
  if (error != std::errc() || !(seconds >= 0 && seconds <= 1e6)) return std::nullopt;
  text.remove_prefix(static_cast<std::size_t>(end - text.data()));
  return Duration::microseconds(static_cast<std::int64_t>(seconds * 1e6));
}

bool take(std::string_view& text, char wanted) {
  if (text.empty() || text.front() != wanted) return false;
  text.remove_prefix(1);
  return true;
}

/// Adds the presses to the button's script. False when `presses` has a wrong form.
bool script(std::string_view presses, hal::sim::SimInputPin& button, Instant start) {
  Instant released = start;
  do {
    const auto at = take_seconds(presses);
    const bool plus = take(presses, '+');
    const auto length = take_seconds(presses);
    if (!at || !plus || !length || start + *at < released || length->ns() == 0) return false;
    released = start + *at + *length;
    button.script(start + *at, true);
    button.script(released, false);
  } while (take(presses, ','));
  return presses.empty();
}

}  // namespace

Result<std::unique_ptr<PanelPorts>> PanelPorts::make(const firmware::PanelConfig& config, hal::ClockPort& clock) {
  auto ports = std::make_unique<PanelPorts>();
  if (config.button.starts_with(kSim)) {
    ports->presses_ = config.button.substr(kSim.size());
    ports->clock_ = &clock;
    hal::sim::SimInputPin trial(clock);
    if (!script(ports->presses_, trial, clock.now())) {
      return fail(Errc::kBadValue, "panel.button is \"" + config.button + "\"; it " + std::string(kHow));
    }
  }
  constexpr bool kLampOff = false;  // level of a lamp whose lease has expired
  if (config.status.starts_with(kSim)) ports->status_.emplace(kLampOff);
  if (config.tally.starts_with(kSim)) ports->tally_.emplace(kLampOff);
  return ports;
}

void PanelPorts::make_safe() noexcept {
  for (auto* lamp : {&status_, &tally_}) {
    if (*lamp) (*lamp)->make_safe();
  }
}

firmware::PanelPins PanelPorts::pins() {
  if (clock_ != nullptr) script(presses_, button_.emplace(*clock_), clock_->now());
  return {button_ ? &*button_ : nullptr, status_ ? &*status_ : nullptr, tally_ ? &*tally_ : nullptr};
}

}  // namespace nodal::daemon
