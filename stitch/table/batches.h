// Batches of tiles whose pixels are written in runs (GridTable::batches), for raymaps whose rays were sorted into
// tiles.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "protocol/base/image.h"
#include "stitch/blend/blend_table.h"

namespace nodal::table {

/// The components of the raymap that are on a grid: 0 is full resolution, 1 the chroma of I420 and NV12.
std::size_t components_on(PixelFormat raymap, int grid);

/// Adds batches to a grid that has places. They are as large as the buffer allows; where `cells` (SphereOrder) begin, a
/// batch has whole cells if at least one fits. Adds none if runs would be short.
void add_batches(blend::GridTable& grid, std::size_t components, std::span<const std::uint32_t> cells);

/// What is wrong with the grid's places and batches; null: nothing. Then every pixel is written exactly once, with
/// batches and without: to its place.
const char* fault_of_places(const blend::GridTable& grid, std::size_t components);

}  // namespace nodal::table
