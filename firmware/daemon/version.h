// The name and version of nodald in its hello and its log.
#pragma once

#include "protocol/base/version.h"

namespace nodal::daemon {
inline constexpr const char* kSoftware = "nodald " NODAL_VERSION;
}
