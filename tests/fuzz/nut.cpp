// What a decoder's pipe gives: every frame that is read is in the input, and times keep their range.
#include <algorithm>
#include <cstdlib>

#include "host_tool/film/nut_reader.h"
#include "memory_limit.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace nodal;
  static const bool limited = (fuzz::limit_memory(std::size_t{16} << 20), true);
  (void)limited;
  std::size_t at = 0;
  film::NutReader reader([&](std::span<std::uint8_t> into) -> Result<std::size_t> {
    const std::size_t count = std::min(into.size(), size - at);
    std::copy_n(data + at, count, into.begin());
    at += count;
    return count;
  });
  const auto video = reader.begin();
  if (!video) return 0;
  NODAL_ASSERT(video->width > 0 && video->height > 0 && video->time_base.num > 0 && video->time_base.den > 0);
  std::vector<std::uint8_t> picture(
      std::min<std::size_t>(4096, static_cast<std::size_t>(video->width) * static_cast<std::size_t>(video->height)));
  for (std::size_t frames = 0;; ++frames) {
    NODAL_ASSERT(frames <= size);
    const auto time = reader.next(picture);
    if (!time || !*time) return 0;
    NODAL_ASSERT(std::abs(**time) <= std::int64_t{1} << 60);
  }
}
