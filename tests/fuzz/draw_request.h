// Requests of every kind with telling values, drawn from a fuzzer's input.
#pragma once

#include "protocol/base/bytes.h"
#include "protocol/nodal.pb.h"

namespace nodal::fuzz {

/// One request of any kind of wire::Request; half of them also have unknown fields, in the request or in
/// the message within it, up to what a request frame may hold.
wire::Request draw_request(ByteReader& in);

}  // namespace nodal::fuzz
