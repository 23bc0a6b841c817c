// A calibration of a stranger is installed only after a process of its own has parsed and compiled it.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "firmware/config/config.h"
#include "firmware/frame/frame_set.h"
#include "hal/confined.h"
#include "protocol/base/result.h"
#include "protocol/calibration.h"
#include "stitch/sets/plan_job.h"

namespace nodal::firmware {

/// The only way in which a rig begins to compile. Errors: those of PlanJob; kTooLarge for work above its budget.
Result<sets::PlanJob> plan_within_budget(const Calibration& fitted, const RigConfig& config, const HeadShapes& heads);

/// The document and what the heads deliver.
hal::ConfinedJob rehearsal_job(std::string json, const HeadShapes& heads);

/// Everything that installing this document does before the disk changes: parses it, fits it to the rig, makes its plan
/// with validated tables, and forgets it. Compiling has no other input, so what comes through here comes through in
/// nodald.
/// Errors: those of the calibration and of PlanJob.
Result<std::vector<std::uint8_t>> rehearse(const RigConfig& config, const hal::ConfinedJob& job,
                                           const hal::ConfinedProgress& progress);

/// Addresses that a rehearsal may need beside those of the program: a table has 4 to 40 bytes a pixel, and is joined
/// from two halves.
std::uint64_t rehearsal_bytes(const RigConfig& config);
inline constexpr std::uint64_t kMaxRehearsalBytesAPixel = 256;
/// What a document and the sampling of the heads need, whatever the raymap's size.
inline constexpr std::uint64_t kMaxRehearsalBytes = std::uint64_t{256} << 20;

}  // namespace nodal::firmware
