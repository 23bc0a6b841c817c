#include "stitch/geometry/raymap/listed_rays.h"

#include <fmt/format.h>

#include <bit>
#include <string>

#include "protocol/base/angles.h"

namespace nodal::geometry {

Result<std::unique_ptr<RaymapLayout>> ListedRays::make(RaymapSize size, std::int64_t digits) {
  const RayList* list = known_ray_list(std::bit_cast<std::uint64_t>(digits));
  if (list == nullptr) return fail(Errc::kNotFound, "the list of rays is not known here; give its file");
  if (list->size.width != size.width || list->size.height != size.height) {
    return fail(Errc::kBadValue, fmt::format("the list of rays is for raymaps of {}x{}, not {}x{}", list->size.width,
                                             list->size.height, size.width, size.height));
  }
  return std::unique_ptr<RaymapLayout>(new ListedRays(*list));
}

double ListedRays::solid_angle(int, int) const { return 4 * kPi / width() / height(); }

Ray ListedRays::ray_of(int i, int j) const {
  const std::array<double, 3>& ray =
      list_.rays[static_cast<std::size_t>(j) * static_cast<std::size_t>(width()) + static_cast<std::size_t>(i)];
  return Ray::towards(ray[0], ray[1], ray[2]);
}

}  // namespace nodal::geometry
