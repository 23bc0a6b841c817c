// XMP packets of pictures, as nodal convert and stitch read and write them.
#include <cstddef>
#include <cstdint>
#include <string_view>

#include "memory_limit.h"
#include "protocol/base/result.h"
#include "stitch/media/xmp/xmp.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const bool limited = (nodal::fuzz::limit_memory(std::size_t{64} << 20), true);
  (void)limited;
  using namespace nodal::media;
  const XmpWords words = parse_xmp({reinterpret_cast<const char*>(data), size});
  // What is kept is read again from what is written.
  const XmpWords again = parse_xmp(gpano_packet(64, 32, words.kept));
  NODAL_ASSERT(again.area && again.kept.size() == words.kept.size());
  return 0;
}
