// Settings to change on a device, collected until its worker applies them.
#pragma once

#include <optional>

#include "protocol/base/units.h"

namespace nodal::hal::device {

/// The settings to change; others keep their values.
struct ControlChange {
  std::optional<Exposure> exposure;
  std::optional<Gain> gain;
  std::optional<WhiteBalance> white_balance;

  /// Newer values replace older ones.
  void add(const ControlChange& newer) {
    if (newer.exposure) exposure = newer.exposure;
    if (newer.gain) gain = newer.gain;
    if (newer.white_balance) white_balance = newer.white_balance;
  }
};

}  // namespace nodal::hal::device
