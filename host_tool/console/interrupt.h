// Ctrl-C: for loops that wait for a rig, a request to finish properly; for a computation, an immediate end.
#pragma once

namespace nodal::host {

class Console;

/// From now on the first SIGINT or SIGTERM is only recorded; a second one ends the program at once. Also ignores
/// SIGPIPE and SIGXFSZ, so that a closed pipe and an exceeded file size limit become errors of write().
void watch_interrupts();
bool interrupted();
/// The received signal, SIGINT or SIGTERM; 0 if there was none.
int interrupting_signal();

/// While an object exists, interrupted() is false, for requests that undo something after Ctrl-C. A second signal still ends
/// the program at once.
///
/// Threading: created and destroyed on the main thread, one at a time.
/// Ownership: none.
/// Errors: none.
class [[nodiscard]] UndoesDespiteInterrupts {
 public:
  UndoesDespiteInterrupts();
  ~UndoesDespiteInterrupts();
  UndoesDespiteInterrupts(const UndoesDespiteInterrupts&) = delete;
  UndoesDespiteInterrupts& operator=(const UndoesDespiteInterrupts&) = delete;
};

/// While an object exists, the first SIGINT or SIGTERM ends the program at once, with a sentence and its exit code.
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
