// Validates a table before it is used (kernels do not check).
#pragma once

#include <vector>

#include "protocol/base/result.h"
#include "stitch/blend/blend_table.h"

namespace nodal::table {

/// Proves that blend_rows and validity_rows, called with heads and a raymap that match the table, read and write only
/// inside them and never overflow, and that the weights of every covered pixel sum to exactly one. Checks that sizes
/// and grids fit the format; tiles have their records, weights, lists and gains; heads and levels exist; every patch is
/// inside its plane; the four samples of every pixel with weight are inside the patch's rows and the plane; weights and
/// gains are in range.
///
/// Threading: thread-safe.
/// Errors: kTableInvalid, naming the grid and the tile.
Status validate_blend_table(const blend::BlendTable& table);

/// The same for a table that differs from a proven one only in these tiles of its own grids: tiles[grid][tile].
Status validate_tiles(const blend::BlendTable& table, const std::vector<std::vector<bool>>& tiles);

}  // namespace nodal::table
