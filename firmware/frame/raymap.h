// What the blend makes: one raymap, and everything that is known of it.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "firmware/frame/frame_set.h"
#include "protocol/base/field.h"
#include "protocol/base/loan.h"
#include "protocol/base/sha256.h"
#include "protocol/base/units.h"
#include "stitch/blend/linear_tone.h"

namespace nodal::firmware {

/// Bytes that one stage fills and several outlets read without a copy; the stage's pool lends them.
using Buffer = Loan<std::vector<std::uint8_t>>;

/// Which of a set's two fields a raymap was made of.
struct FieldOfSet {
  int number = 0;  ///< 0: the one exposed first
  FieldParity parity = FieldParity::kTop;
};

struct RaymapInfo {
  std::uint64_t set = 0;
  Instant mid_exposure;             ///< of the field, where it was made of one
  std::optional<FieldOfSet> field;  ///< nothing: of whole frames
  SyncEvidence sync;
  HeadMask heads = 0;                                    ///< that it was made of
  Sha256 calibration{};                                  ///< that made it
  std::array<hal::HeadSettings, kMaxHeads> in_effect{};  ///< of the heads that it was made of
  std::optional<blend::LinearScale> linear;              ///< of raymaps of 16 bits
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
