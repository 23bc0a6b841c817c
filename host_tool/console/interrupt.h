// Ctrl-C, a closed terminal and other signals that end a program (hal::SignalOutcome::kEnds): for loops that wait for a
// rig, a request to finish properly; for a computation, an immediate end.
#pragma once

#include <string>

namespace nodal::host {

class Console;

/// From now on the first of these signals is only recorded; a second one of the same kind ends the program at once.
/// Signals of kIgnored are ignored, so that a closed pipe and an exceeded file size limit become errors of write().
void watch_interrupts();
bool interrupted();
/// The received signal; 0 if there was none.
int interrupting_signal();
/// "Ctrl-C", "SIGHUP": for messages, after interrupted().
std::string interrupt_name();

/// While an object exists, interrupted() is false on its thread: for a last request to a rig after a signal. A second
/// signal of the same kind still ends the program at once.
///
/// Threading: created and destroyed on the same thread.
/// Ownership: none.
/// Errors: none.
class [[nodiscard]] LastRequest {
 public:
  LastRequest();
  ~LastRequest();
  LastRequest(const LastRequest&) = delete;
  LastRequest& operator=(const LastRequest&) = delete;
};

/// While an object exists, the first such signal ends the program at once, with a sentence and its exit code.
///
/// Threading: created and destroyed on the main thread, one at a time.
/// Ownership: none.
/// Errors: none.
class [[nodiscard]] EndsAtOnce {
 public:
  explicit EndsAtOnce(const Console& console);
  ~EndsAtOnce();
  EndsAtOnce(const EndsAtOnce&) = delete;
  EndsAtOnce& operator=(const EndsAtOnce&) = delete;
};

/// Runs a computation of several seconds, on any number of threads, that a signal may end at any moment: it must not
/// write files or hold anything that needs cleanup.
template <class Work>
auto interruptible(const Console& console, const Work& work) {
  const EndsAtOnce scope(console);
  return work();
}

}  // namespace nodal::host
