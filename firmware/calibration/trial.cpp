#include "firmware/calibration/trial.h"

#include <utility>

namespace nodal::firmware {

void CalibrationTrial::enter(State from, State to) {
  NODAL_ASSERT(state_ == from);
  state_ = to;
}

void CalibrationTrial::prepare(Calibration calibration, std::optional<SignedDocument> original, sets::BlendSetup before,
                               Duration lasts) {
  enter(State::kNone, State::kPreparing);
  NODAL_ASSERT(before);
  report_ = Trial{calibration_id(calibration), calibration.name, before.plan->id, {}};
  calibration_ = std::move(calibration);
  original_ = std::move(original);
  before_ = std::move(before);
  lasts_ = lasts;
}

void CalibrationTrial::run(Instant now) {
  enter(State::kPreparing, State::kRunning);
  report_.until = now + lasts_;
}

void CalibrationTrial::give_up() {
  enter(State::kPreparing, State::kNone);
  before_ = {};
}

void CalibrationTrial::keep() {
  enter(State::kRunning, State::kNone);
  before_ = {};
}

sets::BlendSetup CalibrationTrial::go_back() {
  enter(State::kRunning, State::kNone);
  return std::exchange(before_, {});
}

const Trial& CalibrationTrial::report() const {
  NODAL_ASSERT(running());
  return report_;
}

const Calibration& CalibrationTrial::calibration() const {
  NODAL_ASSERT(running());
  return calibration_;
}

const std::optional<SignedDocument>& CalibrationTrial::original() const {
  NODAL_ASSERT(running());
  return original_;
}

}  // namespace nodal::firmware
