// What a seed draws: a rig, its nature, and what befalls it.
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

/// What may befall one head, two, or all of them.
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

/// How a head is when it befalls it.
enum class HeadState : std::uint8_t { kAway, kStarting, kFree, kTriggered, kSilent };
inline constexpr int kHeadStates = 5;
std::string_view name_of(HeadState state);

enum class HowMany : std::uint8_t { kOne, kTwo, kAll };
inline constexpr int kHowMany = 3;
std::string_view name_of(HowMany many);

/// What befalls the rig as a whole.
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

/// For as long as the world lasts.
struct Nature {
  std::uint64_t seed = 0;
  int heads = 0;
  FrameRate rate;
  bool genlocked = false;                ///< at start; of an aligned rig, that its heads are moved into step
  bool aligned = false;                  ///< it has no trigger, and its heads run free
  bool can_align = false;                ///< and all of them can be brought into step
  Fields fields = Fields::kProgressive;  ///< of every head; where there are any, each makes a raymap
  bool hosts = false;                    ///< somebody talks to it
  bool hostile = false;                  ///< some of what befalls it is hostile clients
  Duration look_every;                   ///< how often the daemon's threads wake when nothing rings
  Duration poll;                         ///< devices do not ring: frames are found at multiples of this
  int blend_every = 1;                   ///< of the sets, those that are blended
  TriggerNature trigger;
  std::vector<HeadNature> head;
  std::optional<firmware::OutletSpec> reader;  ///< something else reads the raymaps, too
};

struct DrawOptions {
  bool faults = true;    ///< false: nothing goes wrong
  int heads = 0;         ///< 0: drawn
  bool ntsc = false;     ///< 29.97 a second and genlocked, not drawn
  bool hostile = false;  ///< all that befalls the rig is hostile clients
};

Nature draw_nature(std::uint64_t seed, const DrawOptions& options);

/// A rig.toml for it, and one of two calibrations; under the first a grey picture's level is kept, under the second
/// it is halved.
firmware::RigConfig config_of(const Nature& nature);
Calibration calibration_of(const Nature& nature, int which);
inline constexpr int kCalibrations = 2;

}  // namespace nodal::swarm
