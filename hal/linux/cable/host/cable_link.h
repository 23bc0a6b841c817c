// The host's end of the cable, through libusb.
#pragma once

#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "hal/link.h"
#include "protocol/base/result.h"

namespace nodal::hal::cable {

/// A rig that is plugged in. Texts are the device's, with '?' for every character that is not printable ASCII.
struct PluggedRig {
  std::string serial;  ///< empty if it has none
  std::string name;    ///< the rig's, from rig.toml
  std::string place;   ///< where it is plugged in, such as "1-2.3"
};

/// Errors: kIo when USB cannot be used at all.
Result<std::vector<PluggedRig>> plugged_rigs();

/// Opens a rig: the one with this serial, or the only one if `serial` is empty. Waits up to 3 s for the rig's answer;
/// the link itself never waits, except that closing it waits up to 1 s for the rig to take what was written.
/// Errors: kUnreachable (no such rig, several rigs, no answer, no permission), kBusy (another program uses it),
///   kVersionMismatch, kIo.
Result<std::unique_ptr<LinkPort>> connect_cable(std::string_view serial);

}  // namespace nodal::hal::cable
