#pragma once

namespace nodal::daemon {

inline constexpr const char* kSoftware = "nodald 0.1.0";

}  // namespace nodal::daemon
