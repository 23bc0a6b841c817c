// Draws requests of every kind with revealing values from a fuzzer's input.
#pragma once

#include "protocol/base/bytes.h"
#include "protocol/nodal.pb.h"

namespace nodal::fuzz {

/// One request of any kind of wire::Request; half of them also have unknown fields, in the request or in its inner
/// message, up to the limit of a request frame.
wire::Request draw_request(ByteReader& in);

}  // namespace nodal::fuzz
