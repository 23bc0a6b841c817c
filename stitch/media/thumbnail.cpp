#include "stitch/media/thumbnail.h"

#include <utility>

#include "protocol/base/image.h"
#include "stitch/media/jpeg_reader.h"
#include "stitch/media/jpeg_writer.h"

namespace nodal::media {
namespace {

constexpr int kQuality = 80;

}  // namespace

Result<std::vector<std::uint8_t>> thumbnail(std::span<const std::uint8_t> jpeg, const std::string& name) {
  const Result<DecodedImage> small = decode_jpeg_eighth(jpeg, name);
  if (!small) return fail(small.error());
  JpegWriter writer({.format = small->format, .width = small->width, .height = small->height, .quality = kQuality});
  std::vector<std::uint8_t> file;
  if (const Status written = writer.write(small->view(), "", file); !written) return fail(written.error());
  return file;
}

bool is_whole_jpeg(std::span<const std::uint8_t> bytes) {
  return bytes.size() >= 4 && bytes[0] == 0xFF && bytes[1] == 0xD8 && bytes[bytes.size() - 2] == 0xFF &&
         bytes.back() == 0xD9;
}

}  // namespace nodal::media
