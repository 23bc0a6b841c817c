// A calibration on trial: it runs for a while, and the disk knows nothing of it.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "firmware/calibration/calibration_store.h"
#include "firmware/frame/installed_calibration.h"
#include "protocol/base/units.h"
#include "protocol/calibration.h"

namespace nodal::firmware {

/// One that runs, as status shows it.
struct Trial {
  Sha256 id{};
  std::string name;
  Sha256 before{};  ///< what the rig goes back to
  Instant until;    ///< when it does so by itself
};

/// The states of a trial, and what has to be at hand so that it can end either way:
///
/// | state | from | ends with |
/// |---|---|---|
/// | kNone | | prepare() |
/// | kPreparing: its table is compiled | prepare() | run(), or give_up() when there is no table |
/// | kRunning | run() | keep(), or go_back() |
///
/// Threading: thread-bound to the keeper.
/// Ownership: holds the calibration in force before, with its table, until the trial has ended.
/// Errors: none; a call in another state is a mistake of the program.
class CalibrationTrial {
 public:
  enum class State : std::uint8_t { kNone, kPreparing, kRunning };

  State state() const { return state_; }
  bool running() const { return state_ == State::kRunning; }

  void prepare(Calibration calibration, std::optional<SignedDocument> original, InstalledPtr before, Duration lasts);
  /// Its time begins.
  void run(Instant now);
  void give_up();
  /// It is on the disk: there is nothing to go back to.
  void keep();
  /// What was in force before.
  InstalledPtr go_back();

  /// While it is running().
  const Trial& report() const;
  const Calibration& calibration() const;
  /// As it was uploaded, when it was signed.
  const std::optional<SignedDocument>& original() const;
  bool overdue(Instant now) const { return running() && now >= report_.until; }

 private:
  void enter(State from, State to);

  State state_ = State::kNone;
  Trial report_;
  Calibration calibration_;
  std::optional<SignedDocument> original_;
  InstalledPtr before_;
  Duration lasts_;
};

}  // namespace nodal::firmware
