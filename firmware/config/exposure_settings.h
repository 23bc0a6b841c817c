// The settings of the exposure programs, from rig.toml and from hosts.
#pragma once

#include <cstdint>
#include <optional>
#include <string_view>

#include "hal/head.h"
#include "protocol/base/stops.h"
#include "protocol/base/units.h"

namespace nodal::firmware {

enum class ExposureProgram : std::uint8_t {
  kManual,  ///< hosts set every head
  kEach,    ///< every head is exposed for its own picture
  kJoint,   ///< as kEach, but overlapping heads differ by at most `difference`
};
/// "manual", "each", "joint": the name in rig.toml and in the protocol.
std::string_view exposure_program_name(ExposureProgram program);
std::optional<ExposureProgram> exposure_program_of(std::string_view name);

/// All settings of the exposure programs.
struct ExposureSettings {
  ExposureProgram program = ExposureProgram::kManual;
  std::optional<HeadIndex> anchor;  ///< joint: this head is exposed for its own picture, the others relative to it
  Stops target = -5 * kStop / 2;    ///< mean light relative to a full sample, in stops
  Stops difference = kStop;         ///< joint: most between overlapping heads; 0: all heads have the same exposure
  Stops ramp = 4 * kStop;           ///< most that an exposure changes from one set to the next
  Exposure longest = Exposure::microseconds(16'000);  ///< longest shutter time; gain supplies the rest
  Gain highest = Gain::millidecibels(24'000);
  bool locked = false;  ///< the program does not change exposures
  friend bool operator==(const ExposureSettings&, const ExposureSettings&) = default;
};

/// A change of some fields of ExposureSettings. Capture applies it to the settings in effect at that moment, so that
/// two requests in quick succession both take effect.
struct ExposureChange {
  std::optional<ExposureProgram> program;
  std::optional<std::optional<HeadIndex>> anchor;  ///< the inner one is empty: no head is the anchor
  std::optional<Stops> target, difference, ramp;
  std::optional<Exposure> longest;
  std::optional<Gain> highest;
  std::optional<bool> locked;

  ExposureSettings applied_to(ExposureSettings settings) const;
  /// Fields that `newer` has replace this one's.
  void add(const ExposureChange& newer);
};

}  // namespace nodal::firmware
