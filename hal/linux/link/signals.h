// What both programs do with each signal. By default, most signals end a program without any cleanup.
#pragma once

#include <csignal>
#include <string>

namespace nodal::hal {

enum class SignalOutcome {
  kEnds,     ///< the program ends properly: nodald ends its take and removes its sockets, nodal ends its command
  kIgnored,  ///< nothing happens
  kCrashes,  ///< the kernel ends the program, for a fault of the program; nodald makes its outputs safe first
  kKernels,  ///< no program can change it (SIGKILL, SIGSTOP), or it stops, continues or does nothing by default
};

/// The outcome of every signal from 1 to SIGRTMAX. The manual pages have this table, and a test sends each signal to
/// both programs.
SignalOutcome outcome_of(int signal);
/// "SIGHUP", "SIGRTMIN+3"; the number for a signal without a name.
std::string signal_name(int signal);

/// Signals of kEnds. Without SIGHUP if the program was started with SIGHUP ignored, as `nohup` does.
sigset_t ending_signals();
/// Signals of kIgnored.
sigset_t ignored_signals();
/// Ignores them. Call it before the first thread starts. A program that is spawned must reset them, as spawn_link()
/// does.
void ignore_stray_signals();

}  // namespace nodal::hal
