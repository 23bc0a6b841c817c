#include "host_tool/rig/stream_wait.h"

#include <fmt/format.h>

#include <algorithm>
#include <optional>
#include <utility>
#include <variant>

#include "host_tool/console/quantities.h"
#include "protocol/base/try.h"

namespace nodal::host {

Result<Event> StreamWait::next() {
  while (!floor_.stalled(rig_.now())) {
    NODAL_TRY_ASSIGN(std::optional<Event> event,
                     rig_.next_event_of(stream_, std::max(Duration(), floor_.left(rig_.now()))));
    floor_.moved_to(rig_.received(stream_), rig_.now());
    if (event) return std::move(*event);
  }
  return fail(Errc::kTimeout, fmt::format("{}: the rig sent less than {} of {} in {} (--timeout waits longer)",
                                          rig_.address(), show_bytes(kMinBytesAWindow), what_,
                                          show_duration(static_cast<std::uint64_t>(floor_.window().ns()))));
}

}  // namespace nodal::host
