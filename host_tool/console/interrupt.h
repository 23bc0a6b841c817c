// Ctrl-C: a request to end in good order, seen by loops that wait for a rig; and the end at once of a computation.
#pragma once

namespace nodal::host {

class Console;

/// From here on the first SIGINT or SIGTERM is only noted; a second one ends the program at once. Also ignores SIGPIPE
/// and SIGXFSZ, so that a reader that goes away and a file over its size limit are errors of write().
void watch_interrupts();
bool interrupted();
/// SIGINT or SIGTERM, whichever came; 0 when neither did.
int interrupting_signal();

/// While it lives, the first SIGINT or SIGTERM ends the program at once, with one sentence and the exit code of that signal.
///
/// Threading: made and destroyed on main, one at a time.
/// Ownership: none.
/// Errors: none.
class [[nodiscard]] EndsAtOnce {
 public:
  explicit EndsAtOnce(const Console& console);
  ~EndsAtOnce();
  EndsAtOnce(const EndsAtOnce&) = delete;
  EndsAtOnce& operator=(const EndsAtOnce&) = delete;
};

/// Runs a computation of seconds, on any number of threads, that a signal may end at any moment: it must write no file
/// and hold nothing that must be put in order.
template <class Work>
auto interruptible(const Console& console, const Work& work) {
  const EndsAtOnce scope(console);
  return work();
}

}  // namespace nodal::host
