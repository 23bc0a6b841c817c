// Placed seams in the evidence of a take: which head shows each pixel of a small map, as runs.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "protocol/base/result.h"
#include "protocol/base/units.h"
#include "protocol/take/evidence.pb.h"

namespace nodal::take {

/// Columns of a map, which has half as many rows: at most 32768 pixels, and a byte of runs for each.
inline constexpr std::uint32_t kMaxSeamColumns = 256;
/// The label of a pixel that no head shows.
inline constexpr std::uint8_t kNoHeadOfSeams = 255;

/// Seams in force from the rig's set `set` on. `labels`: of a map of `columns` columns, row by row, each the index of a
/// head or kNoHeadOfSeams; empty: the calibration's own seams.
wire::Seams seams_record(std::uint64_t set, std::uint32_t columns, std::span<const std::uint8_t> labels);

/// Errors: kBadFormat for a map of another size than its columns say, or that names another head than the first
/// `heads`. Allocates nothing otherwise.
Status check_seams(const wire::Seams& seams, std::size_t heads = kMaxHeads);
/// The labels; empty: the calibration's own seams. Errors: those of check_seams().
Result<std::vector<std::uint8_t>> labels_of(const wire::Seams& seams);

}  // namespace nodal::take
