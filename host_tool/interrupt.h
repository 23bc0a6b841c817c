// Ctrl-C as a request to end in good order, seen by loops that would otherwise go on for ever.
#pragma once

namespace nodal::host {

/// From here on the first SIGINT or SIGTERM is only noted; a second one ends the program at once. Also
/// ignores SIGPIPE, so that a reader that goes away is an error of write() and nothing worse.
void watch_interrupts();
bool interrupted();

}  // namespace nodal::host
