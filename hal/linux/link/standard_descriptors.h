// Descriptors 0, 1 and 2, which a shell may have closed (`nodal status >&-`).
#pragma once

namespace nodal::hal {

/// Opens /dev/null on each of the descriptors 0 to 2 that is closed. Otherwise the program's first socket would get
/// that number, and text for standard output would go into the conversation with the rig. Each is opened in the unused
/// direction, so that reading standard input and writing standard output or error still fail. Call it first in main(),
/// before anything is opened.
void guard_standard_descriptors();

}  // namespace nodal::hal
