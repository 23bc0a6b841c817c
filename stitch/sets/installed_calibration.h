// A calibration in the form that the blend uses: its tables, compiled and validated.
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

namespace nodal::decode {
class FrameDecoder;
}

namespace nodal::sets {

class SeamViews;
struct SeamPictures;

/// Columns of the map of the sphere on which seams are placed; half as many rows. Pixels of 1.4 degrees.
inline constexpr int kSeamMapWidth = 256;
/// seams::Labels on this map; null: the calibration's own, fixed seams.
using SeamLabels = std::shared_ptr<const std::vector<std::uint8_t>>;

/// Immutable.
struct InstalledCalibration {
  Sha256 id{};
  std::string name;
  /// One table for whole frames; or two, one per field, with the table of the field exposed first in front.
  std::vector<blend::BlendTable> tables;
  blend::SetTone tone;  ///< for heads with the exposures they were calibrated at
  std::shared_ptr<std::vector<std::uint8_t>>
      prepared;  ///< scratch memory of the blend, for the prepared pictures that a table requires
  /// Scratch memory of the blend, too: what decodes each head's frames where the blend cannot read them as they are.
  std::vector<std::shared_ptr<decode::FrameDecoder>> decoders;
  blend::MeterTable meter;
  blend::ToneTable exposures;              ///< compensates the differences between the heads' exposures
  std::shared_ptr<const SeamViews> seams;  ///< of placed seams; null: seams are fixed
  /// Memory of the views of one set, for placing seams; null where they are fixed.
  std::shared_ptr<SeamPictures> seam_pictures;
  SeamLabels seam_labels;  ///< that the tables were made with
};
using InstalledPtr = std::shared_ptr<const InstalledCalibration>;

/// Allocates all memory that blending with these tables needs, so that the frame path allocates none. heads[i] delivers
/// pictures of format delivered[i]; without `delivered`, of the format that the tables are for.
InstalledPtr make_installed(const Sha256& id, std::string name, std::vector<blend::BlendTable> tables,
                            blend::MeterTable meter = {}, blend::ToneTable exposures = {},
                            const std::vector<PixelFormat>& delivered = {},
                            std::shared_ptr<const SeamViews> seams = {});

/// The same calibration with other seams; shares all memory but that of the tables. For one with SeamViews.
/// Errors: those of SeamViews::tables().
Result<InstalledPtr> with_seams(const InstalledCalibration& installed, std::vector<std::uint8_t> labels);

}  // namespace nodal::sets
