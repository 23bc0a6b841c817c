// What a segment must say beyond what read_evidence() checks, for everybody who reads a take, and for the recovery that
// writes one.
#pragma once

#include <cstdint>

#include "protocol/base/result.h"
#include "protocol/take/documents.h"
#include "protocol/take/evidence.h"

namespace nodal::media {

/// How many sets of a take come before a segment.
struct SetsBefore {
  std::uint64_t kept = 0;     ///< sets in the segments before it
  std::uint64_t deleted = 0;  ///< sets that were deleted to make room for newer ones
};

/// Whether the segment, by its name number `number`, may come after the others, and whether its pictures have the sizes
/// of their formats and belong to heads of the take. Errors: kBadFormat, kTooLarge.
Status check_segment(const take::Segment& segment, std::uint32_t number, const take::TakeDocument& about,
                     SetsBefore before);

}  // namespace nodal::media
