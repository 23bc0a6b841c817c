// Which patch of a head's picture holds the samples of a tile's pixels, and the pixels' coordinates in it.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "stitch/blend/blend_table.h"
#include "stitch/table/tile_fit.h"

namespace nodal::table {

/// Tolerance of a coordinate, in 1 / (1 << kFractionBits): 1/64 px.
inline constexpr int kPatchFit = 64;

/// The record for the pixels of one mask, or the pair for those of two: the upper and the lower half of the tile. x, y:
/// the pixels' places in a plane of width x height samples, in 1 / (1 << kFractionBits). Coordinates are a quadratic if
/// that is within kPatchFit of every pixel's, else they are appended to `coordinates` as a list. Head and level are
/// left 0. Nothing if the patches cannot hold the pixels; one pixel always fits.
std::optional<std::array<blend::PatchRecord, 2>> fit_patches(const PixelValues& x, const PixelValues& y,
                                                             std::span<const PixelMask> masks, int width, int height,
                                                             std::vector<std::uint16_t>& coordinates);

}  // namespace nodal::table
