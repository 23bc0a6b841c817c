// Hugin's masks: k i0 t0 p"x y x y ...", a polygon of image 0 whose inside is excluded.
#pragma once

#include <optional>
#include <span>
#include <string>

#include "protocol/base/result.h"
#include "protocol/calibration.h"
#include "stitch/interchange/import.h"
#include "stitch/interchange/panotools_script.h"

namespace nodal::interchange {

/// Adds the masks to the heads of `result`; `head_of` is each image's head, or nothing for one that is no head. Masks
/// without an equivalent in Nodal are left out with a note: masks that keep their inside, and polygons that a
/// calibration cannot hold.
/// Errors: kBadValue, with the line, for text that is not a list of numbers, or for an unknown image.
Status add_masks(std::span<const ScriptLine* const> lines, std::span<const std::optional<std::size_t>> head_of,
                 ImportResult& result);

/// The k lines for a head's masks.
std::string mask_lines(const Region& region, std::size_t image);

}  // namespace nodal::interchange
