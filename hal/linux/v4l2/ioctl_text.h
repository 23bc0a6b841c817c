// V4L2's requests and their arguments as text, for a trace.
#pragma once

#include <string>

namespace nodal::hal::v4l2 {

/// "VIDIOC_S_FMT"; a request that nodald does not make, by its number.
std::string request_name(unsigned long request);
/// What the program asks for, read before the call: "640x480 YUYV (YUYV 4:2:2)". Empty if the request's name says it
/// all. `argument` is what the request's ioctl takes.
std::string asked_text(unsigned long request, const void* argument);
/// What the driver answered, read after a call that succeeded. Empty if it answers nothing.
std::string answered_text(unsigned long request, const void* argument);

}  // namespace nodal::hal::v4l2
