// protobuf's own messages on standard error.
#pragma once

namespace nodal {

/// protobuf prints a line to standard error for every message that it cannot parse, which a hostile peer or file could
/// use to fill the log. Our own errors report the same problem. From the first call on nothing is printed.
void silence_protobuf();

}  // namespace nodal
