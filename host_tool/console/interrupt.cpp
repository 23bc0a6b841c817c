#include "host_tool/console/interrupt.h"

#include <csignal>

namespace nodal::host {
namespace {

volatile std::sig_atomic_t interrupt_seen = 0;

void note_interrupt(int signal) { interrupt_seen = signal; }

}  // namespace

void watch_interrupts() {
  struct sigaction action {};
  action.sa_handler = note_interrupt;
  sigemptyset(&action.sa_mask);
  action.sa_flags = static_cast<int>(SA_RESETHAND);  // no SA_RESTART: a wait ends when it comes
  sigaction(SIGINT, &action, nullptr);
  sigaction(SIGTERM, &action, nullptr);
  signal(SIGPIPE, SIG_IGN);
  signal(SIGXFSZ, SIG_IGN);
}

bool interrupted() { return interrupt_seen != 0; }

int interrupting_signal() { return interrupt_seen; }

}  // namespace nodal::host
