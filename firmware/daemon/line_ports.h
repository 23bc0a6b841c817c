// The GPIO lines of rig.toml: trigger, button and lamps.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "firmware/config/config.h"
#include "firmware/operate/panel.h"
#include "hal/linux/gpio/pins.h"
#include "hal/linux/gpio/trigger.h"
#include "protocol/base/result.h"

namespace nodal::daemon {

/// Claims the lines, outputs at their safe levels. A rig runs without what cannot be claimed: then start() of the
/// trigger is that error, and the pin is not there.
///
/// Threading: made and destroyed on main; the ports as their headers say.
/// Ownership: owns the ports; the system outlives it.
/// Errors: problems().
class LinePorts {
 public:
  LinePorts(const firmware::RigConfig& config, hal::gpio::System& system);

  /// Null when rig.toml names no line for it.
  hal::TriggerPort* trigger();
  /// Adds the pins that are GPIO lines.
  void add_to(firmware::PanelPins& pins) const;
  void make_safe() noexcept;
  /// What cannot be claimed, naming the key of rig.toml.
  const std::vector<Error>& problems() const { return problems_; }
  /// What works, but less well than it could: a sentence for the log, or empty.
  const std::string& notice() const { return notice_; }

 private:
  void claim_trigger(const firmware::RigConfig& config);
  void claim_pins(const firmware::PanelConfig& config);

  hal::gpio::System& system_;
  std::unique_ptr<hal::TriggerPort> trigger_;
  hal::gpio::Pins pins_;
  firmware::PanelPins panel_;
  std::vector<Error> problems_;
  std::string notice_;
};

/// What `nodald --safe-levels` does after a crash: claims every output line of rig.toml at its safe level and releases
/// it, and controllers keep the level.
struct SafeLevels {
  std::vector<std::string> lines;  ///< a sentence for each line at its safe level
  std::vector<Error> problems;
};
SafeLevels set_safe_levels(const firmware::RigConfig& config, hal::gpio::System& system);

}  // namespace nodal::daemon
