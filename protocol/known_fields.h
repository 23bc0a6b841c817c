// Messages without the fields that this version does not know.
#pragma once

#include "protocol/nodal.pb.h"

namespace nodal {

/// Drops the fields that a newer host, or a hostile one, added to a request. protobuf keeps the bytes of unknown fields
/// in the message and copies them with it, so a request that a rig holds or stores would otherwise be as large as its
/// sender likes.
void drop_unknown_fields(wire::Request& request);

}  // namespace nodal
