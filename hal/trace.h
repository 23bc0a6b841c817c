// The output of a trace of a port's calls.
#pragma once

#include <functional>
#include <string>

namespace nodal::hal {

/// Takes one line about one call, such as "/dev/video0: VIDIOC_STREAMON". Texts of devices in it are as the device gave
/// them, so whoever shows a line passes it through printable(). Called on the thread that made the call.
using TraceLine = std::function<void(const std::string& line)>;

}  // namespace nodal::hal
