#include "host_tool/console/interrupt.h"

#include <unistd.h>

#include <atomic>
#include <csignal>
#include <string>

#include "hal/linux/link/signals.h"
#include "host_tool/console/console.h"
#include "host_tool/console/exit_code.h"

namespace nodal::host {
namespace {

volatile std::sig_atomic_t interrupt_seen = 0;
thread_local int last_requests = 0;

/// The output of the signal handler while an EndsAtOnce exists, prepared because the handler must not allocate.
struct Farewell {
  std::string to_error, to_output;
};
Farewell farewell;
std::atomic<const Farewell*> ends_at_once{nullptr};
static_assert(std::atomic<const Farewell*>::is_always_lock_free);

void end_at_once(const Farewell& say, int signal) {
  (void)!::write(STDERR_FILENO, say.to_error.data(), say.to_error.size());
  (void)!::write(STDOUT_FILENO, say.to_output.data(), say.to_output.size());
  ::_exit(static_cast<int>(exit_code_of_signal(signal)));
}

void note_interrupt(int signal) {
  interrupt_seen = signal;
  if (const Farewell* say = ends_at_once.load()) end_at_once(*say, signal);
}

}  // namespace

void watch_interrupts() {
  struct sigaction action {};
  action.sa_handler = note_interrupt;
  sigemptyset(&action.sa_mask);
  action.sa_flags = static_cast<int>(SA_RESETHAND);  // no SA_RESTART: the signal interrupts a wait
  const sigset_t ending = hal::ending_signals();
  for (int signal = 1; signal < SIGRTMIN; ++signal) {
    if (sigismember(&ending, signal) == 1) sigaction(signal, &action, nullptr);
  }
  hal::ignore_stray_signals();
}

bool interrupted() { return interrupt_seen != 0 && last_requests == 0; }

LastRequest::LastRequest() { ++last_requests; }
LastRequest::~LastRequest() { --last_requests; }

int interrupting_signal() { return interrupt_seen; }
std::string interrupt_name() { return interrupt_seen == SIGINT ? "Ctrl-C" : hal::signal_name(interrupt_seen); }

EndsAtOnce::EndsAtOnce(const Console& console) {
  const Error error{Errc::kCancelled, "stopped by a signal before the work was done"};
  const std::string over_progress = console.err_is_terminal() ? "\r\x1b[K" : "";
  farewell = {over_progress + console.error_text(error), console.json() ? console.error_document(error) : ""};
  ends_at_once.store(&farewell);
  if (interrupted()) end_at_once(farewell, interrupting_signal());  // the signal came before
}

EndsAtOnce::~EndsAtOnce() { ends_at_once.store(nullptr); }

}  // namespace nodal::host
