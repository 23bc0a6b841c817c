// Lists of rays. An accepted one has as many rays as its size, of length 1, and no two that are the same.
#include "stitch/geometry/raymap/ray_list.h"

#include <cmath>
#include <string_view>

#include "memory_limit.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace nodal;
  static const bool limited = (fuzz::limit_memory(std::size_t{64} << 20), true);
  (void)limited;
  if (size > (1U << 16)) return 0;
  const auto list = geometry::parse_ray_list({reinterpret_cast<const char*>(data), size});
  if (!list) {
    NODAL_ASSERT(!list.error().message.empty() && list.error().message.size() < 2000);
    return 0;
  }
  const auto count = static_cast<std::size_t>(list->size.width) * static_cast<std::size_t>(list->size.height);
  NODAL_ASSERT(list->rays.size() == count && count <= size);
  for (std::size_t k = 0; k < count; ++k) {
    const auto& ray = list->rays[k];
    NODAL_ASSERT(std::abs(std::hypot(ray[0], ray[1], ray[2]) - 1) < 1e-12);
    for (std::size_t other = 0; other < k && count < 100; ++other) NODAL_ASSERT(list->rays[other] != ray);
  }
  return 0;
}
