// The directories of a TIFF: as a block of Exif, and that block in another TIFF.
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "memory_limit.h"
#include "protocol/base/result.h"
#include "stitch/media/tiff/exif_block.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace nodal;
  static const bool limited = (fuzz::limit_memory(std::size_t{64} << 20), true);
  (void)limited;
  const std::vector<std::uint8_t> block = media::exif_block(std::span(data, size));
  NODAL_ASSERT(media::exif_block(block) == block);
  // A TIFF of one entry, as libtiff writes it: all that the block holds is found again, and the same from the second.
  std::vector<std::uint8_t> file{'I', 'I', 42, 0, 8, 0, 0, 0, 1, 0, 0, 1, 4, 0, 1, 0, 0, 0, 100, 0, 0, 0, 0, 0, 0, 0};
  std::vector<std::uint8_t> again = file;
  media::add_exif(file, block);
  const std::vector<std::uint8_t> copied = media::exif_block(file);
  NODAL_ASSERT(copied.empty() == block.empty());
  media::add_exif(again, copied);
  NODAL_ASSERT(media::exif_block(again) == copied);
  // Any bytes as a block.
  std::vector<std::uint8_t> other{'M', 'M', 0, 42, 0, 0, 0, 8, 0, 1, 1, 0, 0, 4, 0, 0, 0, 1, 0, 0, 0, 100, 0, 0, 0, 0};
  media::add_exif(other, std::span(data, size));
  NODAL_ASSERT(other.size() < std::size_t{1} << 20);
  return 0;
}
