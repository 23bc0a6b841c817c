// The tests that every OutputPinPort and InputPinPort must pass. To add an implementation: add a world that can measure
// the line outside the port.
#pragma once

#include <gtest/gtest.h>

#include <functional>
#include <memory>
#include <ostream>
#include <string>

#include "hal/pin.h"

namespace nodal::hal {

class PinWorld {
 public:
  virtual ~PinWorld() = default;
  virtual OutputPinPort& output() = 0;
  virtual bool safe_level() const = 0;
  /// The output's level, measured outside the port.
  virtual bool output_wire() = 0;
  virtual InputPinPort& input() = 0;
  /// Drives the input from outside; it is low at first.
  virtual void drive_input(bool high) = 0;
  virtual Instant now() = 0;
  virtual void pass(Duration time) = 0;
};

struct PinWorldKind {
  std::string name;
  std::function<std::unique_ptr<PinWorld>()> make;
  friend std::ostream& operator<<(std::ostream& out, const PinWorldKind& kind) { return out << kind.name; }
};

class PinConformance : public testing::TestWithParam<PinWorldKind> {
 protected:
  std::unique_ptr<PinWorld> world_ = GetParam().make();
};

}  // namespace nodal::hal
