// What a file's first bytes say, where nodal and nodald look before a reader does: its kind, and what Exif and a
// profile say of its colours.
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>

#include "memory_limit.h"
#include "protocol/base/result.h"
#include "protocol/base/text.h"
#include "stitch/media/file_kind.h"
#include "stitch/media/plain_image.h"
#include "stitch/media/srgb_profile.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace nodal;
  static const bool limited = (fuzz::limit_memory(std::size_t{64} << 20), true);
  (void)limited;
  const std::span<const std::uint8_t> bytes(data, size);
  for (const char* name : {"a", "a.jpg", "a.NEF", "a.heic", "a.bmp"}) {
    const media::FileKind* kind = media::file_kind(bytes, name);
    NODAL_ASSERT(kind == nullptr || is_printable(media::text_of(*kind)));
    // Only pictures have no kind, and nothing that is empty.
    NODAL_ASSERT(kind != nullptr ||
                 (size > 0 && (data[0] == 0xFF || data[0] == 0x89 || media::begins_like_tiff(bytes))));
  }
  ImageHeader header{1, 1};
  header.metadata.exif.assign(data, data + size);
  const Status by_exif = media::check_plain(header, "p.jpg");
  NODAL_ASSERT(by_exif || by_exif.error().code == Errc::kUnsupported);
  header.meaning.icc.assign(data, data + size);
  const Status by_profile = media::check_plain(header, "p.jpg");
  NODAL_ASSERT(size == 0 || by_profile.has_value() == media::is_srgb_profile(bytes));
  return 0;
}
