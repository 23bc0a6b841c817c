// The Exif of a TIFF, whose directories are spread over the file, as a block of its own, and back. Internal to
// stitch/media/tiff.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace nodal::media {

/// Entries of a directory, and bytes of an entry, that are copied.
inline constexpr std::size_t kMaxExifEntries = 128;
inline constexpr std::size_t kMaxExifEntryBytes = 1024;

/// FileMetadata::exif: maker, model and date of the first directory, the Exif and the GPS directory. Empty if the file
/// has neither of these two and no date, or is a BigTIFF. What is broken is left out. `file`: a whole TIFF.
std::vector<std::uint8_t> exif_block(std::span<const std::uint8_t> file);

/// The reverse: adds maker, model, date, and the Exif and GPS directories of a block to a TIFF, behind its bytes, and
/// puts a new first directory behind them. Entries that the TIFF has already stay. `file`: a TIFF with one directory,
/// no BigTIFF.
void add_exif(std::vector<std::uint8_t>& file, std::span<const std::uint8_t> block);

}  // namespace nodal::media
