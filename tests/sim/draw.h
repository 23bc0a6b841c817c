// Draws a rig, its parameters and its faults from a seed.
#pragma once

#include <cstdint>
#include <optional>
#include <string_view>
#include <vector>

#include "firmware/config/config.h"
#include "hal/sim/scene/random.h"
#include "protocol/calibration.h"
#include "tests/sim/head.h"
#include "tests/sim/reader.h"
#include "tests/sim/trigger.h"

namespace nodal::swarm {

/// Faults of one head, two heads, or all heads.
enum class HeadFault : std::uint8_t {
  kLose,
  kCorrupt,
  kTear,
  kNoSignal,
  kDuplicate,
  kLate,
  kStall,
  kUnplug,
  kWrongSize,
  kStuckExposure,
  kSequenceWraps,
  kStartsAtZero,
  kTimeWraps,
  kMissesPulses,
  kDeaf,
};
inline constexpr int kHeadFaults = 15;
std::string_view name_of(HeadFault fault);

/// The state of a head when a fault begins.
enum class HeadState : std::uint8_t { kAway, kStarting, kFree, kTriggered, kSilent };
inline constexpr int kHeadStates = 5;
std::string_view name_of(HeadState state);

enum class HowMany : std::uint8_t { kOne, kTwo, kAll };
inline constexpr int kHowMany = 3;
std::string_view name_of(HowMany many);

/// Faults of the rig as a whole.
enum class RigFault : std::uint8_t {
  kPulsesMissing,
  kPulsesUnseen,
  kPulsesExtra,
  kTriggerDrifts,
  kTriggerGone,
  kClockStep,
  kSuspend,
  kCaptureStalls,
  kBlendStalls,
  kKeeperStalls,
  kControlStalls,
  kDiskFull,
  kDiskFails,
  kDiskSlow,
  kKilled,
  kPowerLoss,
  kLinkSplit,
  kLinkReset,
  kLinkStalls,
  kLinkReplays,
  kLinkFlips,
  kHostGoneMidUpload,
  kStorm,
};
inline constexpr int kRigFaults = 23;
std::string_view name_of(RigFault fault);

/// Parameters that are constant for a whole run.
struct Nature {
  std::uint64_t seed = 0;
  int heads = 0;
  FrameRate rate;
  bool genlocked = false;  ///< the genlock runs from the start; if aligned, the heads are nudged into step
  bool aligned = false;    ///< it has no trigger; its heads run free
  bool can_align = false;  ///< all heads of an aligned rig can be brought into step
  Fields fields = Fields::kProgressive;  ///< field order of every head; if interlaced, each field makes a raymap
  PixelFormat raymap = PixelFormat::kGrey8;
  bool hosts = false;    ///< whether hosts talk to it
  bool hostile = false;  ///< whether some faults are hostile clients
  Duration look_every;   ///< interval of the daemon's wake-ups without events
  Duration poll;         ///< devices send no events: frames are found at multiples of this
  int blend_every = 1;   ///< one of so many sets is blended
  TriggerNature trigger;
  std::vector<HeadNature> head;
  std::optional<firmware::OutletSpec> reader;  ///< a second reader of the raymaps
};

struct DrawOptions {
  bool faults = true;    ///< false: no faults
  int heads = 0;         ///< 0: random
  bool ntsc = false;     ///< 29.97 per second and genlocked, instead of random
  bool hostile = false;  ///< all faults are hostile clients
};

Nature draw_nature(std::uint64_t seed, const DrawOptions& options);

/// A rig.toml for it, and one of two calibrations: with the first a grey picture's level is kept, with the second it is
/// halved.
firmware::RigConfig config_of(const Nature& nature);
Calibration calibration_of(const Nature& nature, int which);
inline constexpr int kCalibrations = 2;

}  // namespace nodal::swarm
