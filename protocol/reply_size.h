// The maximum length of a reply, by its content.
#pragma once

#include <cstdint>
#include <span>

#include "protocol/base/result.h"

namespace nodal {

/// Two bytes on the wire can make one list element of about two hundred bytes in memory. So only the field that holds a
/// calibration document may be long; the rest of a reply has at most kMaxListReplyBytes. Does not parse the message.
/// Errors: kTooLarge; kProtocol for bytes that are not a message.
Status check_reply_size(std::span<const std::uint8_t> payload);

}  // namespace nodal
