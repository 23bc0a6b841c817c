// Points in time, as people write and read them: UTC by the rig's clock.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "protocol/base/result.h"

namespace nodal::host {

/// "2026-11-26 12:30:15"; "unknown" for times before 1970, which are of a clock that was not set.
std::string show_utc(std::int64_t ns);

/// A time ago ("90min", "1m", "2h", "3d") or a date, with a time or without, in UTC ("2026-11-26", "2026-11-26 12:30",
/// "2026-11-26T12:30:15Z"). Returns nanoseconds since 1970. `now_ns`: for times ago; 0: unknown.
/// Errors: kBadValue with examples; kNotReady for a time ago when `now_ns` is unknown.
Result<std::int64_t> parse_point_in_time(std::string_view text, std::int64_t now_ns);

}  // namespace nodal::host
