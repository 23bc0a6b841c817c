// Writes each call to GPIO lines down: for whoever wires a rig for the first time.
#pragma once

#include <string>
#include <vector>

#include "hal/linux/gpio/system.h"
#include "hal/trace.h"

namespace nodal::hal::gpio {

/// Passes every call on, and writes a line about it:
///
///     gpio:gpiochip0:17: claimed as an output, low
///     gpio:gpiochip0:17: set high
///     gpio:gpiochip0:22: rising edge at 12.345678901 s
///
/// Writing costs the thread of the pulses some time before their next one, so a pulse train that is traced may be less
/// exact.
///
/// Threading: thread-safe, as System.
/// Ownership: `system` outlives it and its lines.
class TracedSystem final : public System {
 public:
  TracedSystem(System& system, TraceLine write) : system_(system), write_(std::move(write)) {}

  Claim claim_output(const LineName& line, bool high) override;
  Claim claim_input(const LineName& line, const InputOptions& options) override;
  std::string holder(const LineName& line) override { return system_.holder(line); }
  std::vector<std::string> chips() override { return system_.chips(); }
  Instant now() override { return system_.now(); }
  Running run(const RunOptions& options, Step step) override { return system_.run(options, std::move(step)); }

 private:
  Claim traced(const LineName& line, Claim claim, const std::string& as) const;

  System& system_;
  const TraceLine write_;
};

}  // namespace nodal::hal::gpio
