#pragma once

#include <cstddef>
#include <utility>

#include "firmware/frame/outlet.h"
#include "protocol/base/spsc_ring.h"

namespace nodal::firmware {

/// Takes what a ring holds, at most its capacity. What another thread pushes meanwhile waits for the next step, so a
/// step ends however fast others push. Returns whether there was something.
template <class T, class Use>
bool drain(SpscRing<T>& ring, Use use) {
  for (std::size_t taken = 0; taken < ring.capacity(); ++taken) {
    auto value = ring.pop();
    if (!value) return taken > 0;
    use(std::move(*value));
  }
  return true;
}

/// The same for an outlet.
template <class T, class Use>
bool drain(Outlet<T>& outlet, Use use) {
  for (std::size_t taken = 0; taken < outlet.spec().waiting; ++taken) {
    auto value = outlet.take();
    if (!value) return taken > 0;
    use(std::move(*value));
  }
  return true;
}

}  // namespace nodal::firmware
