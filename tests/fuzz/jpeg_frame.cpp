// The decoder of cameras' JPEG frames, for heads of the size that a frame claims, and of another one.
#include <algorithm>
#include <cstdint>
#include <span>
#include <vector>

#include "memory_limit.h"
#include "protocol/base/result.h"
#include "stitch/decode/jpeg_frame.h"

namespace nodal::fuzz {
namespace {

constexpr int kLargestSide = 256;

void decode_as(std::span<const std::uint8_t> jpeg, PixelFormat format, int width, int height) {
  constexpr std::uint8_t kGuard = 0xA5;
  constexpr std::size_t kGuards = 64;
  const std::size_t size = packed_size(format, width, height);
  std::vector<std::uint8_t> bytes(size + kGuards, kGuard);
  static decode::JpegDecoder decoder;  // one for all frames, as on board
  (void)decoder.decode(jpeg, packed_image(format, width, height, bytes.data()));
  for (std::size_t i = size; i < bytes.size(); ++i) NODAL_ASSERT(bytes[i] == kGuard);
}

}  // namespace
}  // namespace nodal::fuzz

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace nodal;
  static const bool limited = (fuzz::limit_memory(std::size_t{64} << 20), true);
  (void)limited;
  int width = 16;
  int height = 16;
  for (std::size_t i = 0; i + 9 < size; ++i) {  // the first start of frame
    if (data[i] != 0xFF || (data[i + 1] & 0xFC) != 0xC0) continue;
    height = std::min(data[i + 5] << 8 | data[i + 6], fuzz::kLargestSide);
    width = std::min(data[i + 7] << 8 | data[i + 8], fuzz::kLargestSide);
    break;
  }
  for (const PixelFormat format : {PixelFormat::kI420, PixelFormat::kRgb24, PixelFormat::kGrey8}) {
    fuzz::decode_as({data, size}, format, std::max(width, 1), std::max(height, 1));
    fuzz::decode_as({data, size}, format, 24, 17);
  }
  return 0;
}
