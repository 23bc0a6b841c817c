// The rig's own button and lamps, for operation without a host.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "hal/pin.h"
#include "protocol/base/frame_time.h"
#include "protocol/base/units.h"

namespace nodal::firmware {

/// A null pin: the rig does not have it.
struct PanelPins {
  hal::InputPinPort* button = nullptr;   ///< high while it is pressed
  hal::OutputPinPort* status = nullptr;  ///< lamp: the rig's state
  hal::OutputPinPort* tally = nullptr;   ///< lamp: the rig rolls
};

enum class PanelAction : std::uint8_t { kStart, kMark, kStop };

/// The data that the lamps show.
struct PanelView {
  std::string_view state;  ///< Health::state
  bool rolling = false;    ///< a take is recorded, or, in a rig that records nothing, the genlock runs
  std::uint64_t sets = 0;  ///< number of frame sets so far
  Duration period;         ///< period of the frame rate in force
};

/// One button. In a rig that records, `rolling` means that a take is being recorded; in others, that the genlock runs:
///
/// | pressed            | not rolling | rolling |
/// |--------------------|-------------|---------|
/// | shorter than kHold | start       | mark    |
/// | for kHold          | start       | stop    |
///
/// The stop comes after kHold, before the release, so the tally lamp goes off while the button is still pressed. Levels
/// shorter than kSettle are ignored as contact bounce.
///
/// The status lamp repeats a pattern: starting `--__`, no-calibration two short flashes, idle one short flash, running
/// on, degraded fast `-_-_`. The tally lamp is on while it rolls and sets arrive, off when none arrived for kSilent,
/// and flickers for kMarkShown after a mark. Both have a lease of kLease, so they are off after a daemon hangs or dies.
///
/// Threading: thread-bound to control. Ownership: the pins outlive it.
/// Errors: a pin that failed is not used again, and take_problem() reports it once.
class Panel {
 public:
  static constexpr Duration kSettle = Duration::milliseconds(20);
  static constexpr int kEdgesAStep = 64;  ///< the next step reads the rest of a bouncing contact
  static constexpr Duration kHold = Duration::milliseconds(1500);
  static constexpr Duration kLease = Duration::milliseconds(500);
  static constexpr FrameTime kSilent{Duration::milliseconds(500), 4};
  static constexpr Duration kMarkShown = Duration::milliseconds(600);

  explicit Panel(const PanelPins& pins)
      : button_(pins.button),
        status_{pins.status, "status lamp", false, {}},
        tally_{pins.tally, "tally lamp", false, {}} {}

  /// How often step() must be called while the rig has a button or a lamp.
  static constexpr Duration kStepEvery = Duration::milliseconds(10);
  bool present() const { return button_ != nullptr || status_.pin != nullptr || tally_.pin != nullptr; }
  /// Returns at most one action of the button per call.
  std::optional<PanelAction> step(const PanelView& view, Instant now);
  std::optional<std::string> take_problem();

  /// Whether the status lamp is on at time `into` in the pattern of a state; it is off in an unknown state.
  static bool status_lamp(std::string_view state, Duration into);

 private:
  std::optional<PanelAction> read_button(bool rolling, Instant now);
  std::optional<PanelAction> settle(bool rolling, Instant now);
  bool tally_lamp(const PanelView& view, Instant now);
  struct Lamp {
    hal::OutputPinPort* pin = nullptr;
    std::string_view name;
    bool on = false;
    std::optional<Instant> set;  ///< time of the last successful set()
  };
  void light(Lamp& lamp, bool on, Instant now);
  void lose(std::string_view name, const Error& why);

  hal::InputPinPort* button_;
  Lamp status_;
  Lamp tally_;
  bool level_ = false;  ///< level after the newest edge
  Instant level_since_;
  bool pressed_ = false;  ///< debounced level
  Instant pressed_since_;
  bool acted_ = false;  ///< this press has had its action
  std::optional<Instant> marked_;
  std::string state_;
  Instant state_since_;
  std::uint64_t sets_ = 0;
  std::optional<Instant> newest_set_;
  std::vector<std::string> problems_;
};

}  // namespace nodal::firmware
