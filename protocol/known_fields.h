// Removes from messages the fields that this version does not know.
#pragma once

#include "protocol/nodal.pb.h"

namespace nodal {

/// Drops the fields that a newer or hostile host added to a request. protobuf keeps and copies the bytes of unknown
/// fields with the message, so without this a request that a rig holds or stores could be as large as its sender
/// chooses.
void drop_unknown_fields(wire::Request& request);

}  // namespace nodal
