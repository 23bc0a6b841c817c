// The HEIF reader, which opens head pictures and spheres.
#include "coded_picture.h"
#include "stitch/media/heif_webp/heif_reader.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace nodal;
  fuzz::read_coded({data, size}, media::heif_header, media::decode_heif, media::decode_heif_opacity);
  return 0;
}
