// A calibration in the form that runs: its tables, compiled and proven.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "protocol/base/sha256.h"
#include "stitch/blend/blend_table.h"
#include "stitch/blend/exposure_tone.h"
#include "stitch/blend/meter.h"
#include "stitch/blend/tone.h"

namespace nodal::firmware {

/// Immutable.
struct InstalledCalibration {
  Sha256 id{};
  std::string name;
  /// One for whole frames; or one a field, that of the field exposed first before the other's.
  std::vector<blend::BlendTable> tables;
  blend::SetTone tone;  ///< of heads exposed as they were when calibrated
  std::shared_ptr<std::vector<std::uint8_t>>
      prepared;  ///< the blender's, for what a table asks to be made of heads' pictures before the blend
  blend::MeterTable meter;
  blend::ToneTable exposures;  ///< undoes what heads are exposed differently by
};
using InstalledPtr = std::shared_ptr<const InstalledCalibration>;

/// Takes all the memory that blending by the table will need, so that the frame path takes none.
InstalledPtr make_installed(const Sha256& id, std::string name, std::vector<blend::BlendTable> tables,
                            blend::MeterTable meter = {}, blend::ToneTable exposures = {});

}  // namespace nodal::firmware
