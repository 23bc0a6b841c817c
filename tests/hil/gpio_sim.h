// The kernel's simulated GPIO chips, controlled from outside their lines.
#pragma once

#include <string>

#include "hal/linux/gpio/system.h"

namespace nodal::hil {

/// A chip of gpio-sim, made through configfs; its label is `label`.
///
/// Errors: std::runtime_error.
class SimChip {
 public:
  SimChip(const std::string& label, int lines);
  ~SimChip();
  SimChip(const SimChip&) = delete;
  SimChip& operator=(const SimChip&) = delete;

  hal::gpio::LineName line(std::uint32_t offset) const { return {name_, offset}; }
  const std::string& name() const { return name_; }  ///< "gpiochip0"
  /// The level on the wire.
  bool wire(std::uint32_t offset) const;
  /// The file that holds it, as 0 or 1.
  std::string wire_file(std::uint32_t offset) const { return lines_ + std::to_string(offset) + "/value"; }
  /// Drives the line from outside: sets its pull, which a program's output overrides.
  void drive(std::uint32_t offset, bool high) const;
  /// Removes the chip, also while lines are in use.
  void remove();

 private:
  const std::string folder_;
  std::string name_;
  std::string lines_;  ///< folder with the lines' attributes
};

/// A line that another program with this name holds as an output.
class HeldLine {
 public:
  HeldLine(const std::string& chip, std::uint32_t offset, const std::string& program);
  ~HeldLine();
  HeldLine(const HeldLine&) = delete;
  HeldLine& operator=(const HeldLine&) = delete;

 private:
  int fd_ = -1;
};

/// Waits, in the guest's virtual time.
void wait_for(Duration time);
void wait_until(Instant at);

}  // namespace nodal::hil
