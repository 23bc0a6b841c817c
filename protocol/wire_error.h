#pragma once

#include "protocol/base/result.h"
#include "protocol/nodal.pb.h"

namespace nodal {

/// Both ways, a message of more than 1000 bytes is cut, and unprintable characters are replaced: names of files and
/// devices may be any bytes.
wire::Error to_wire(const Error& error);
/// The error that a peer tells. A code that does not fit becomes the highest.
Error from_wire(const wire::Error& message);

}  // namespace nodal
