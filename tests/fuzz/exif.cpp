// What cameras write into pictures, as nodal stitch reads it.
#include <cstddef>
#include <cstdint>

#include "memory_limit.h"
#include "protocol/base/result.h"
#include "stitch/media/exif/exif.h"
#include "stitch/media/exif/place_and_time.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const bool limited = (nodal::fuzz::limit_memory(std::size_t{64} << 20), true);
  (void)limited;
  const nodal::media::Exif exif = nodal::media::parse_exif({data, size});
  NODAL_ASSERT(exif.orientation >= 1 && exif.orientation <= 8);
  NODAL_ASSERT(!exif.focal_35mm || (*exif.focal_35mm >= 1 && *exif.focal_35mm <= 2000));
  nodal::FileMetadata block;
  block.exif.assign(data, data + size);
  (void)nodal::media::place_and_time(block, true);
  return 0;
}
