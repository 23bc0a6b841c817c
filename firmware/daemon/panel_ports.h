// The pins that rig.toml's [panel] names.
#pragma once

#include <memory>
#include <optional>

#include "firmware/config/config.h"
#include "firmware/operate/panel.h"
#include "hal/clock.h"
#include "hal/sim/pin.h"
#include "protocol/base/result.h"

namespace nodal::daemon {

/// Pins are simulated: a button that is pressed by a script, and lamps that are lines in memory.
///
/// Threading: make() on main; the pins are thread-bound to control.
/// Ownership: owns the pins; the clock outlives it.
/// Errors: make() gives one that names the key.
class PanelPorts {
 public:
  static Result<std::unique_ptr<PanelPorts>> make(const firmware::PanelConfig& config, hal::ClockPort& clock);
  /// The script's seconds count from here: call it once, when the rig is about to run.
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
