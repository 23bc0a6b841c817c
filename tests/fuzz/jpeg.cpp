// The JPEG reader, which opens head pictures and scenes.
#include "picture.h"
#include "stitch/media/jpeg_reader.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  nodal::fuzz::decode_any({data, size}, nodal::media::jpeg_header);
  return 0;
}
