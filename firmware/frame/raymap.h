// The output of the blend: one raymap and its metadata.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "firmware/frame/frame_set.h"
#include "firmware/frame/line_vector.h"
#include "protocol/base/field.h"
#include "protocol/base/loan.h"
#include "protocol/base/sha256.h"
#include "protocol/base/units.h"
#include "stitch/blend/linear_tone.h"

namespace nodal::firmware {

/// Bytes that one stage writes and several outlets read without a copy; a loan from that stage's pool.
using PixelsLoan = Loan<LineVector>;
using JpegLoan = Loan<std::vector<std::uint8_t>>;

/// Which of a set's two fields a raymap was made from.
struct FieldOfSet {
  int number = 0;  ///< 0: the field exposed first; 1: the other
  FieldParity parity = FieldParity::kTop;
};

struct RaymapInfo {
  std::uint64_t set = 0;
  Instant mid_exposure;             ///< time of the set; if made from one field, the time of that field
  std::optional<FieldOfSet> field;  ///< empty: made from whole frames
  SyncEvidence sync;
  HeadMask heads = 0;                                    ///< heads whose frames were blended
  Sha256 calibration{};                                  ///< the calibration that the blend used
  std::array<hal::HeadSettings, kMaxHeads> in_effect{};  ///< settings of those heads
  std::optional<blend::LinearScale> linear;              ///< 16-bit raymaps only
  FrameRate rate{};                                      ///< at which sets come
};

/// A raymap in the pipeline. `pixels` are packed in the table's format; behind the encoder they are there only if a
/// client pulls pixels. `jpeg` is there only if a client pulls JPEGs.
struct Raymap {
  RaymapInfo info;
  bool shed = false;  ///< the board is overloaded: only lossless clients receive this raymap
  PixelsLoan pixels;
  JpegLoan jpeg;
};

}  // namespace nodal::firmware
