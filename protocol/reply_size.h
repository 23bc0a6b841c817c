// How long a reply may be, by what it holds.
#pragma once

#include <cstdint>
#include <span>

#include "protocol/base/result.h"

namespace nodal {

/// Two bytes on the wire make one element of a list, which takes some two hundred bytes in memory. So only the field that
/// holds a calibration document may be long; the rest of a reply has at most kMaxListReplyBytes. Parses nothing.
/// Errors: kTooLarge; kProtocol for bytes that are no message.
Status check_reply_size(std::span<const std::uint8_t> payload);

}  // namespace nodal
