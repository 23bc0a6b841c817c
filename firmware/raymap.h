// What the blend makes: one raymap, and everything that is known of it.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "firmware/frame_set.h"
#include "protocol/base/sha256.h"
#include "protocol/base/units.h"
#include "stitch/blend/blend_table.h"

namespace nodal::firmware {

/// A calibration in the form that runs: its table, compiled and proven. Immutable.
struct InstalledCalibration {
  Sha256 id{};
  std::string name;
  blend::BlendTable table;
};
using InstalledPtr = std::shared_ptr<const InstalledCalibration>;

/// Bytes that one stage fills, the next read, and sessions send without a copy.
using Buffer = std::shared_ptr<std::vector<std::uint8_t>>;

struct RaymapInfo {
  std::uint64_t set = 0;
  Instant mid_exposure;
  SyncEvidence sync;
  HeadMask heads = 0;      ///< that it was made of
  Sha256 calibration{};    ///< that made it
};

/// A raymap on its way: `pixels` packed in the table's format, `jpeg` when somebody wants it so.
struct Raymap {
  RaymapInfo info;
  Buffer pixels;
  Buffer jpeg;
};

}  // namespace nodal::firmware
