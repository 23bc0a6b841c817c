// Point pairs in CSV, for a rig of three heads. Accepted pairs name two heads and hold finite numbers, and can be
// written and read back.
#include <cmath>
#include <string>

#include "host_tool/input/pairs_file.h"
#include "memory_limit.h"
#include "tests/support/rigs.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace nodal;
  static const Calibration rig = test::ring(3, 640, 480);
  static const bool limited = (fuzz::limit_memory(std::size_t{64} << 20), true);
  (void)limited;
  if (size > (1U << 16)) return 0;
  const auto pairs = host::parse_pairs_csv(std::string(reinterpret_cast<const char*>(data), size), rig);
  if (!pairs) return 0;
  NODAL_ASSERT(pairs->size() <= size);
  for (const registration::PointPair& pair : *pairs) {
    NODAL_ASSERT(pair.head_a != pair.head_b && pair.head_a < rig.heads.size() && pair.head_b < rig.heads.size());
    for (const double value : {pair.pixel_a.x, pair.pixel_a.y, pair.pixel_b.x, pair.pixel_b.y}) {
      NODAL_ASSERT(std::isfinite(value));
    }
  }
  const auto again = host::parse_pairs_csv(host::pairs_csv(*pairs, rig), rig);
  NODAL_ASSERT(again.has_value() && again->size() == pairs->size());
  for (std::size_t i = 0; i < pairs->size(); ++i) {
    const double before = (*pairs)[i].pixel_a.x;
    NODAL_ASSERT((*again)[i].head_a == (*pairs)[i].head_a && (*again)[i].head_b == (*pairs)[i].head_b);
    NODAL_ASSERT(std::abs((*again)[i].pixel_a.x - before) <= 1e-4 + 1e-9 * std::abs(before));
  }
  return 0;
}
