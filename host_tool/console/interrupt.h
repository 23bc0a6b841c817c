// Ctrl-C as a request to end in good order, seen by loops that would otherwise go on for ever.
#pragma once

namespace nodal::host {

/// From here on the first SIGINT or SIGTERM is only noted; a second one ends the program at once. Also ignores SIGPIPE
/// and SIGXFSZ, so that a reader that goes away and a file over its size limit are errors of write().
void watch_interrupts();
bool interrupted();
/// SIGINT or SIGTERM, whichever came; 0 when neither did.
int interrupting_signal();

}  // namespace nodal::host
