// Which rows of the heads' halved pictures the blend reads: only these are made for every set.
#pragma once

#include "stitch/blend/blend_table.h"

namespace nodal::table {

/// Sets Source::made of all heads from the records of the grids and of the cover.
void name_made_rows(blend::BlendTable& table);

/// Whether Source::made of all heads has the right size, and every row from which something is read. The records must
/// have been proven.
bool all_read_is_made(const blend::BlendTable& table);

}  // namespace nodal::table
