// Validates a table before it is used (kernels do not check).
#pragma once

#include "protocol/base/result.h"
#include "stitch/blend/blend_table.h"

namespace nodal::table {

/// Proves that blend_rows and validity_rows, given heads and a raymap as the table says, read and write only
/// inside them, never overflow, and that weights sum to exactly one wherever there are any: sizes and grids fit
/// the format; tiles have their records, weights, lists and gains; heads and levels exist; every patch is inside its
/// plane, and of every pixel with weight the four samples are inside the patch's rows and the plane; weights and gains
/// are in range.
///
/// Threading: thread-safe.
/// Errors: kTableInvalid, naming the grid and the tile.
Status validate_blend_table(const blend::BlendTable& table);

}  // namespace nodal::table
