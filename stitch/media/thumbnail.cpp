#include "stitch/media/thumbnail.h"

#include <utility>

#include "protocol/base/image.h"
#include "protocol/base/try.h"
#include "stitch/media/jpeg_reader.h"
#include "stitch/media/jpeg_writer.h"

namespace nodal::media {
namespace {

constexpr int kQuality = 80;

}  // namespace

Result<std::vector<std::uint8_t>> thumbnail(std::span<const std::uint8_t> jpeg, const std::string& name) {
  NODAL_TRY_ASSIGN(const DecodedImage small, decode_jpeg_eighth(jpeg, name));
  JpegWriter writer({.format = small.format, .width = small.width, .height = small.height, .quality = kQuality});
  std::vector<std::uint8_t> file;
  NODAL_TRY(writer.write(small.view(), "", file));
  return file;
}

bool is_whole_jpeg(std::span<const std::uint8_t> bytes) {
  return bytes.size() >= 4 && bytes[0] == 0xFF && bytes[1] == 0xD8 && bytes[bytes.size() - 2] == 0xFF &&
         bytes.back() == 0xD9;
}

}  // namespace nodal::media
