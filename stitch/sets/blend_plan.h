// A calibration compiled for the blend.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "protocol/base/image.h"
#include "protocol/base/result.h"
#include "protocol/base/sha256.h"
#include "stitch/blend/blend_table.h"
#include "stitch/blend/exposure_tone.h"
#include "stitch/blend/meter.h"
#include "stitch/blend/tone.h"

namespace nodal::sets {

class SeamViews;
struct BlendMemory;

/// Columns of the map of the sphere on which seams are placed; half as many rows. Pixels of 1.4 degrees.
inline constexpr int kSeamMapWidth = 256;
/// seams::Labels on this map; null: the calibration's own, fixed seams.
using SeamLabels = std::shared_ptr<const std::vector<std::uint8_t>>;

/// What blending with a calibration reads. The memory that it writes to is a BlendMemory.
struct BlendPlan {
  Sha256 id{};
  std::string name;
  /// One table for whole frames; or two, one per field, with the table of the field exposed first in front.
  std::vector<blend::BlendTable> tables;
  std::vector<PixelFormat> delivered;  ///< the format of each head's frames
  blend::SetTone tone;                 ///< used when heads have the exposures that they were calibrated at
  blend::MeterTable meter;
  blend::ToneTable exposures;              ///< compensates the differences between the heads' exposures
  std::shared_ptr<const SeamViews> seams;  ///< null: seams are not placed
  SeamLabels seam_labels;                  ///< the seams that the tables were made with
};
/// Threading: immutable; any thread.
using PlanPtr = std::shared_ptr<const BlendPlan>;

/// The plan with these tables. heads[i] delivers pictures of format delivered[i]; without `delivered`, of the format
/// that the tables are for.
PlanPtr make_plan(const Sha256& id, std::string name, std::vector<blend::BlendTable> tables,
                  blend::MeterTable meter = {}, blend::ToneTable exposures = {},
                  std::vector<PixelFormat> delivered = {}, std::shared_ptr<const SeamViews> seams = {});

/// The same plan with other seams. `plan` has SeamViews. Errors: those of SeamViews::tables().
Result<PlanPtr> with_seams(const BlendPlan& plan, std::vector<std::uint8_t> labels);

/// What a blend adopts and gives back. Only the SetBlend that adopted it writes to the memory; others keep it for
/// later.
struct BlendSetup {
  PlanPtr plan;
  std::shared_ptr<BlendMemory> memory;

  explicit operator bool() const { return plan != nullptr; }
};
/// Allocates the memory for a plan.
BlendSetup with_memory(PlanPtr plan);

}  // namespace nodal::sets
