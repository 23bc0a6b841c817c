// The rig's own button and lamps, for a person in a field without a host.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "hal/pin.h"
#include "protocol/base/units.h"

namespace nodal::firmware {

/// Null: the rig has none.
struct PanelPins {
  hal::InputPinPort* button = nullptr;   ///< high while it is pressed
  hal::OutputPinPort* status = nullptr;  ///< lamp: how the rig is
  hal::OutputPinPort* tally = nullptr;   ///< lamp: the heads are triggered and raymaps are made
};

enum class PanelAction : std::uint8_t { kStart, kMark, kStop };

/// What the lamps tell.
struct PanelView {
  std::string_view state;  ///< Health::state
  bool rolling = false;    ///< the genlock runs
  std::uint64_t sets = 0;  ///< rises while frame sets come
};

/// One button:
///
/// | pressed      | while the rig stands | while it rolls |
/// |--------------|----------------------|----------------|
/// | shorter than kHold | start          | mark           |
/// | for kHold    | start                | stop           |
///
/// kHold counts while it is held, so the tally goes out under the finger. Levels shorter than kSettle are a contact's
/// bouncing and are passed over.
///
/// The status lamp, over and over: starting `--__`, no-calibration two short flashes, idle one short flash, running on,
/// degraded fast `-_-_`. The tally is on while the rig rolls and sets come, off when none came for kSilent, and
/// flickers for kMarkShown after a mark. Both are leased for kLease: a daemon that hangs or dies leaves them dark.
///
/// Threading: thread-bound to control.
/// Ownership: the pins outlive it.
/// Errors: a pin that is gone is left alone, and take_problem() says so once.
class Panel {
 public:
  static constexpr Duration kSettle = Duration::milliseconds(20);
  static constexpr Duration kHold = Duration::milliseconds(1500);
  static constexpr Duration kLease = Duration::milliseconds(500);
  static constexpr Duration kSilent = Duration::milliseconds(500);
  static constexpr Duration kMarkShown = Duration::milliseconds(600);

  explicit Panel(const PanelPins& pins)
      : button_(pins.button),
        status_{pins.status, "status lamp", false, {}},
        tally_{pins.tally, "tally lamp", false, {}} {}

  /// Call at least every few milliseconds. What the button asks for, at most one thing a call.
  std::optional<PanelAction> step(const PanelView& view, Instant now);
  std::optional<std::string> take_problem();

  /// Whether the status lamp is on at so long into the pattern of a state; an unknown state is dark.
  static bool status_lamp(std::string_view state, Duration into);

 private:
  std::optional<PanelAction> read_button(bool rolling, Instant now);
  std::optional<PanelAction> settle(bool rolling, Instant now);
  bool tally_lamp(const PanelView& view, Instant now);
  struct Lamp {
    hal::OutputPinPort* pin = nullptr;
    std::string_view name;
    bool on = false;
    std::optional<Instant> set;  ///< last
  };
  void light(Lamp& lamp, bool on, Instant now);
  void lose(std::string_view name, const Error& why);

  hal::InputPinPort* button_;
  Lamp status_;
  Lamp tally_;
  bool level_ = false;  ///< of the newest edge
  Instant level_since_;
  bool pressed_ = false;  ///< settled
  Instant pressed_since_;
  bool acted_ = false;  ///< this press has done what it does
  std::optional<Instant> marked_;
  std::string state_;
  Instant state_since_;
  std::uint64_t sets_ = 0;
  std::optional<Instant> newest_set_;
  std::vector<std::string> problems_;
};

}  // namespace nodal::firmware
