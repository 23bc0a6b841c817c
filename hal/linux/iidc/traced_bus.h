// Writes each call to IIDC cameras down: for whoever connects one for the first time.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "hal/clock.h"
#include "hal/linux/iidc/bus.h"
#include "hal/trace.h"

namespace nodal::hal::iidc {

/// The register at `offset` from FFFF F000 0000h in the words of the specification, for a camera whose command
/// registers begin at `command_base`: "CUR_V_MODE", "SHUTTER_INQ"; another register, such as one of a mode of format 7,
/// by its offset.
std::string register_name(std::uint64_t offset, std::uint64_t command_base);

/// Passes every call on, and writes a line about it:
///
///     iidc:00b09d0100c0ffee: write CUR_V_MODE = 20000000h
///     iidc:00b09d0100c0ffee: frame in buffer 3, 614400 bytes
///
/// Calls for a frame before there is one are written only when none came for a second.
///
/// Threading: as Bus.
/// Ownership: `bus` and `clock` outlive it and its cameras.
class TracedBus final : public Bus {
 public:
  TracedBus(Bus& bus, ClockPort& clock, TraceLine write) : bus_(bus), clock_(clock), write_(std::move(write)) {}

  int open(std::uint64_t guid, std::unique_ptr<Device>& device) override;
  std::vector<CameraInfo> list() override;

 private:
  Bus& bus_;
  ClockPort& clock_;
  const TraceLine write_;
};

}  // namespace nodal::hal::iidc
