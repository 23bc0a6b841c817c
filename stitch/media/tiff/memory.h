// A TIFF in memory or in a file, as libtiff reads and writes it. Internal to stitch/media/tiff.
#pragma once

#include <tiffio.h>

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

namespace nodal::media {

struct TiffMemory {
  std::vector<std::uint8_t> bytes;
  std::size_t at = 0;
  std::string why;  ///< the last error that libtiff reported
};

struct CloseTiff {
  void operator()(TIFF* tiff) const { TIFFClose(tiff); }
};
using TiffPtr = std::unique_ptr<TIFF, CloseTiff>;

/// `mode` "r" or "w"; null on failure. Reads the bytes where they are, as if the file was mapped: libtiff 4.5 refuses
/// good uncompressed tiles of files that are not. Keeps `memory` by reference.
TiffPtr open_tiff(TiffMemory& memory, const char* mode);

/// The same for an open file, for its directory only; takes over the descriptor. Errors of libtiff go to memory.why.
TiffPtr open_tiff_file(int descriptor, TiffMemory& memory);

}  // namespace nodal::media
