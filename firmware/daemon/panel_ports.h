// The pins of rig.toml's [panel].
#pragma once

#include <memory>
#include <optional>

#include "firmware/config/config.h"
#include "firmware/operate/panel.h"
#include "hal/clock.h"
#include "hal/sim/pin.h"
#include "protocol/base/result.h"

namespace nodal::daemon {

/// The simulated ones: a button with scripted presses, and lamps whose levels exist only in memory. GPIO lines are in
/// line_ports.h.
///
/// Threading: make() on main; the pins are thread-bound to control.
/// Ownership: owns the pins; the clock outlives it.
/// Errors: make() returns one that names the key.
class PanelPorts {
 public:
  static Result<std::unique_ptr<PanelPorts>> make(const firmware::PanelConfig& config, hal::ClockPort& clock);
  /// Starts the clock of the button's script: call it once, just before the rig runs.
  firmware::PanelPins pins();
  void make_safe() noexcept;

 private:
  std::string presses_;
  hal::ClockPort* clock_ = nullptr;  ///< null: no button
  std::optional<hal::sim::SimInputPin> button_;
  std::optional<hal::sim::SimOutputPin> status_;
  std::optional<hal::sim::SimOutputPin> tally_;
};

}  // namespace nodal::daemon
