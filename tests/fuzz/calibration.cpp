// The calibration parser with any input: an accepted document can be written, read back and used.
#include <cmath>
#include <cstdint>
#include <string_view>

#include "protocol/calibration.h"
#include "stitch/geometry/head.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace nodal;
  const Result<Calibration> read = parse_calibration({reinterpret_cast<const char*>(data), size});
  if (!read) {
    NODAL_ASSERT(!read.error().message.empty());
    return 0;
  }
  const std::string canonical = canonical_json(*read);
  for (const std::string& text : {canonical, to_json(*read)}) {
    const Result<Calibration> again = parse_calibration(text);
    NODAL_ASSERT(again.has_value());
    NODAL_ASSERT(*again == *read);
    NODAL_ASSERT(canonical_json(*again) == canonical);
  }
  const Result<std::vector<geometry::Head>> heads = geometry::make_heads(*read);
  NODAL_ASSERT(heads.has_value());
  for (const geometry::Head& head : *heads) {
    for (const double part : {0.0, 0.1, 0.5, 0.9, 1.0}) {
      const geometry::Pixel pixel{part * head.width(), (1 - part) * head.height()};
      if (!head.contains(pixel)) continue;
      // Inside the region, all results are finite.
      const auto ray = head.unproject(pixel);
      NODAL_ASSERT(ray.has_value());
      const auto back = head.project(*ray);
      NODAL_ASSERT(back.has_value() && std::isfinite(back->x) && std::isfinite(back->y));
      NODAL_ASSERT(std::isfinite(head.density(pixel)) && head.density(pixel) >= 0);
      NODAL_ASSERT(head.vignetting(pixel) > 0);
    }
  }
  return 0;
}
