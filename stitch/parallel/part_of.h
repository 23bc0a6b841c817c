// Progress of a part of a job.
#pragma once

#include <functional>
#include <utility>

namespace nodal::parallel {

/// Tells `whole` of a part that begins at `begun` and is `share` of it, both 0..1; `whole` may be empty.
inline std::function<void(double)> part_of(std::function<void(double)> whole, double begun, double share) {
  if (!whole) return {};
  return [whole = std::move(whole), begun, share](double done) { whole(begun + share * done); };
}

}  // namespace nodal::parallel
