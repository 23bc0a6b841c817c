// Which pictures of an HEIF file are made of which others: grids and overlays of tiles, alpha channels.
#pragma once

#include <cstdint>
#include <span>

namespace nodal::media {

/// Pictures that are decoded for all pictures of a file, each as often as others need it.
inline constexpr int kMaxHeifPictures = 1 << 16;
/// A grid has tiles, a tile may be turned, and has an alpha channel: 3.
inline constexpr int kMaxHeifDepth = 8;

/// Whether decoding ends: libheif 1.15 starts a thread for each tile and follows references without a limit, so a grid
/// that is its own tile takes all threads of the computer. False for a file that needs more pictures or a deeper
/// nesting than the limits above.
bool are_references_bounded(std::span<const std::uint8_t> file);

}  // namespace nodal::media
