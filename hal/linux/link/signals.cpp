#include "hal/linux/link/signals.h"

#include <fmt/format.h>

#include <cstring>

namespace nodal::hal {
namespace {

sigset_t all_of(SignalOutcome outcome) {
  sigset_t set;
  sigemptyset(&set);
  for (int signal = 1; signal <= SIGRTMAX; ++signal) {
    if (outcome_of(signal) == outcome) sigaddset(&set, signal);
  }
  return set;
}

bool is_ignored(int signal) {
  struct sigaction now {};
  return ::sigaction(signal, nullptr, &now) == 0 && now.sa_handler == SIG_IGN;
}

}  // namespace

SignalOutcome outcome_of(int signal) {
  switch (signal) {
    case SIGHUP:
    case SIGINT:
    case SIGQUIT:
    case SIGTERM:
    case SIGPWR:   // an uninterruptible power supply is nearly empty
    case SIGXCPU:  // RLIMIT_CPU's soft limit; the hard limit is SIGKILL
      return SignalOutcome::kEnds;
    case SIGPIPE:  // an error of write() reports it
    case SIGXFSZ:  // RLIMIT_FSIZE; an error of write() reports it
    case SIGALRM:
    case SIGVTALRM:
    case SIGPROF:
    case SIGIO:
    case SIGSTKFLT:
    case SIGUSR1:
    case SIGUSR2: return SignalOutcome::kIgnored;
    case SIGILL:
    case SIGTRAP:
    case SIGABRT:
    case SIGBUS:
    case SIGFPE:
    case SIGSEGV:
    case SIGSYS: return SignalOutcome::kCrashes;
    default: return signal >= SIGRTMIN && signal <= SIGRTMAX ? SignalOutcome::kIgnored : SignalOutcome::kKernels;
  }
}

std::string signal_name(int signal) {
  if (signal >= SIGRTMIN && signal <= SIGRTMAX) return fmt::format("SIGRTMIN+{}", signal - SIGRTMIN);
  const char* const name = ::sigabbrev_np(signal);
  return name ? std::string("SIG") + name : std::to_string(signal);
}

sigset_t ending_signals() {
  sigset_t set = all_of(SignalOutcome::kEnds);
  if (is_ignored(SIGHUP)) sigdelset(&set, SIGHUP);
  return set;
}

sigset_t ignored_signals() { return all_of(SignalOutcome::kIgnored); }

void ignore_stray_signals() {
  const sigset_t ignored = ignored_signals();
  for (int signal = 1; signal <= SIGRTMAX; ++signal) {
    if (sigismember(&ignored, signal) == 1) std::signal(signal, SIG_IGN);
  }
}

}  // namespace nodal::hal
