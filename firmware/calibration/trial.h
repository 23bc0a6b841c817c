// A calibration on trial: it is in force for a limited time and is not stored on the disk.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "firmware/calibration/calibration_store.h"
#include "protocol/base/units.h"
#include "protocol/calibration.h"
#include "stitch/sets/blend_plan.h"

namespace nodal::firmware {

/// Status of a running trial.
struct Trial {
  Sha256 id{};
  std::string name;
  Sha256 before{};  ///< the calibration that the rig goes back to
  Instant until;    ///< the end of the trial, unless a host ends it earlier
};

/// The states of a trial, and the data that is needed to end it either way:
///
/// | state | entered by | left by |
/// |---|---|---|
/// | kNone | | prepare() |
/// | kPreparing: its table is being compiled | prepare() | run(), or give_up() when the compilation fails |
/// | kRunning | run() | keep(), or go_back() |
///
/// Threading: thread-bound to the keeper.
/// Ownership: holds the calibration that was in force before, with its tables and memory, until the trial has ended.
/// Errors: none; calls in a wrong state are asserted.
class CalibrationTrial {
 public:
  enum class State : std::uint8_t { kNone, kPreparing, kRunning };

  State state() const { return state_; }
  bool running() const { return state_ == State::kRunning; }

  void prepare(Calibration calibration, std::optional<SignedDocument> original, sets::BlendSetup before,
               Duration lasts);
  /// Starts the time of the trial.
  void run(Instant now);
  void give_up();
  /// The calibration is stored and stays in force: releases the one before.
  void keep();
  /// Ends the trial and returns the calibration that was in force before.
  sets::BlendSetup go_back();

  /// The following three only while running().
  const Trial& report() const;
  const Calibration& calibration() const;
  /// The document as it was uploaded, if signatures are required.
  const std::optional<SignedDocument>& original() const;
  bool overdue(Instant now) const { return running() && now >= report_.until; }

 private:
  void enter(State from, State to);

  State state_ = State::kNone;
  Trial report_;
  Calibration calibration_;
  std::optional<SignedDocument> original_;
  sets::BlendSetup before_;
  Duration lasts_;
};

}  // namespace nodal::firmware
