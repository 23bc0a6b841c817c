// The WebP reader, which opens head pictures and spheres.
#include "coded_picture.h"
#include "stitch/media/heif_webp/webp_reader.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace nodal;
  fuzz::read_coded({data, size}, media::webp_header, media::decode_webp, media::decode_webp_opacity);
  return 0;
}
