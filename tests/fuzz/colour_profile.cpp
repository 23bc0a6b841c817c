// ICC profiles of pictures.
#include <cstddef>
#include <cstdint>

#include "memory_limit.h"
#include "protocol/base/result.h"
#include "stitch/media/colour/colour.h"
#include "stitch/media/srgb_profile.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const bool limited = (nodal::fuzz::limit_memory(std::size_t{256} << 20), true);
  (void)limited;
  for (const nodal::PixelFormat format : {nodal::PixelFormat::kGrey8, nodal::PixelFormat::kRgb48}) {
    nodal::DecodedImage picture{format, 2, 2, {}};
    picture.bytes.assign(nodal::packed_size(format, 2, 2), 100);
    picture.meaning.icc.assign(data, data + size);
    const std::size_t before = picture.bytes.size();
    const nodal::Status done = nodal::media::in_srgb(picture, "p");
    NODAL_ASSERT(picture.bytes.size() == before);
    NODAL_ASSERT(!done || picture.meaning.icc.empty());
    if (done &&
        nodal::media::is_srgb_profile({data, size})) {  // what nodald takes for sRGB, nodal does not change much
      for (std::size_t k = format == nodal::PixelFormat::kGrey8 ? 0 : 1; k < before; k += 2) {
        NODAL_ASSERT(picture.bytes[k] + 3 >= 100 && picture.bytes[k] <= 100 + 3);
      }
    }
  }
  return 0;
}
