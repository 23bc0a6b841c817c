// The index of an MP4 file, with chunk offsets that move by 4 GiB: it grows by what is added and widened, and can be
// written again with the same metadata, once.
#include "host_tool/film/spherical_mp4.h"
#include "memory_limit.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace nodal;
  static const bool limited = (fuzz::limit_memory(std::size_t{64} << 20), true);
  (void)limited;
  const film::Marks marks{true, {0, 0, 0, 0, 0, 1, 0, 0, 0, 0, 0, 1, 0, 0, 0, 0}};
  const film::MovedRange moved{0, UINT32_MAX, std::int64_t{1} << 32};
  const auto made = film::marked_moov({data, size}, {&moved, 1}, marks);
  if (!made) return 0;
  NODAL_ASSERT(made->size() <= 32 * size + 4096);
  const auto again = film::marked_moov(*made, {}, marks);
  NODAL_ASSERT(again.has_value() && again->size() >= made->size());
  return 0;
}
