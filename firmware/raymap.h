// What the blend makes: one raymap, and everything that is known of it.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "firmware/frame_set.h"
#include "protocol/base/field.h"
#include "protocol/base/loan.h"
#include "protocol/base/sha256.h"
#include "protocol/base/units.h"
#include "stitch/blend/blend_table.h"
#include "stitch/blend/exposure_tone.h"
#include "stitch/blend/linear_tone.h"
#include "stitch/blend/meter.h"
#include "stitch/blend/tone.h"

namespace nodal::firmware {

/// Bytes that one stage fills and several outlets read without a copy; the stage's pool lends them.
using Buffer = Loan<std::vector<std::uint8_t>>;

/// A calibration in the form that runs: its tables, compiled and proven. Immutable.
struct InstalledCalibration {
  Sha256 id{};
  std::string name;
  /// One for whole frames; or one a field, that of the field exposed first before the other's.
  std::vector<blend::BlendTable> tables;
  blend::SetTone tone;  ///< of heads exposed as they were when calibrated
  std::shared_ptr<std::vector<std::uint8_t>> prepared;  ///< the blender's, for what a table asks to be made of heads' pictures before the blend
  blend::MeterTable meter;
  blend::ToneTable exposures;  ///< undoes what heads are exposed differently by
};
using InstalledPtr = std::shared_ptr<const InstalledCalibration>;

/// Takes all the memory that blending by the table will need, so that the frame path takes none.
InstalledPtr make_installed(const Sha256& id, std::string name, std::vector<blend::BlendTable> tables,
                            blend::MeterTable meter = {}, blend::ToneTable exposures = {});

/// Which of a set's two fields a raymap was made of.
struct FieldOfSet {
  int number = 0;  ///< 0: the one exposed first
  FieldParity parity = FieldParity::kTop;
};

struct RaymapInfo {
  std::uint64_t set = 0;
  Instant mid_exposure;    ///< of the field, where it was made of one
  std::optional<FieldOfSet> field;  ///< nothing: of whole frames
  SyncEvidence sync;
  HeadMask heads = 0;      ///< that it was made of
  Sha256 calibration{};    ///< that made it
  std::array<hal::HeadSettings, kMaxHeads> in_effect{};  ///< of the heads that it was made of
  std::optional<blend::LinearScale> linear;  ///< of raymaps of 16 bits
};

/// A raymap on its way: `pixels` packed in the table's format, past the encoder only where a client pulls pixels; `jpeg`
/// where one pulls JPEGs.
struct Raymap {
  RaymapInfo info;
  bool shed = false;  ///< the board is overloaded: for lossless clients only
  Buffer pixels;
  Buffer jpeg;
};

}  // namespace nodal::firmware
