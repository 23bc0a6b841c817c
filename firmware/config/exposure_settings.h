// What rig.toml and hosts set of the exposure.
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
  kEach,    ///< every head for what it looks at
  kJoint,   ///< every head for what it looks at, but not further from those it overlaps than `difference`
};
/// "manual", "each", "joint": as rig.toml and the wire have it.
std::string_view exposure_program_name(ExposureProgram program);
std::optional<ExposureProgram> exposure_program_of(std::string_view name);

/// What hosts and rig.toml ask of it.
struct ExposureSettings {
  ExposureProgram program = ExposureProgram::kManual;
  std::optional<HeadIndex> anchor;  ///< joint: this head is exposed for what it looks at, the others after it
  Stops target = -5 * kStop / 2;    ///< mean light, in stops below what fills a sample
  Stops difference = kStop;         ///< joint: between heads that overlap; 0: all are exposed alike
  Stops ramp = 4 * kStop;           ///< an exposure changes by no more from one set to the next
  Exposure longest = Exposure::microseconds(16'000);  ///< shutters are no longer; gain does the rest
  Gain highest = Gain::millidecibels(24'000);
  bool locked = false;  ///< exposures stay as they are
  friend bool operator==(const ExposureSettings&, const ExposureSettings&) = default;
};

/// What a request changes of an ExposureSettings: the fields that it names. Capture applies it to the settings that are
/// in effect then, so that two requests that come one right after the other both count.
struct ExposureChange {
  std::optional<ExposureProgram> program;
  std::optional<std::optional<HeadIndex>> anchor;  ///< the inner one is empty: no head is the anchor
  std::optional<Stops> target, difference, ramp;
  std::optional<Exposure> longest;
  std::optional<Gain> highest;
  std::optional<bool> locked;

  ExposureSettings applied_to(ExposureSettings settings) const;
  /// What `newer` says goes over what this says.
  void add(const ExposureChange& newer);
};

}  // namespace nodal::firmware
