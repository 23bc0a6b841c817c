#include "host_tool/console/exit_code.h"

namespace nodal::host {

bool answered(ExitCode code) {
  return code == ExitCode::kOk || code == ExitCode::kJudged || code == ExitCode::kCannotTell;
}

ExitCode exit_code_of(Errc code) {
  if (code == Errc::kBusy) return ExitCode::kNotNow;  // the link works, but another client has it
  switch (static_cast<int>(code) / 100) {
    case 1:
    case 2: return ExitCode::kBadInput;
    case 3: return ExitCode::kUnreachable;
    case 4: return ExitCode::kDevice;
    case 5: return ExitCode::kStorage;
    case 6: return ExitCode::kNotNow;
    default: return ExitCode::kFailed;
  }
}

ExitCode exit_code_of_signal(int signal) { return static_cast<ExitCode>(128 + signal); }

const std::array<ExitCodeHelp, 15>& exit_code_help() {
  static const std::array<ExitCodeHelp, 15> help{{
      {ExitCode::kOk, "done"},
      {ExitCode::kFailed, "an internal error of Nodal (9xx)"},
      {ExitCode::kUsage, "the command line cannot be understood, or an option has a wrong value"},
      {ExitCode::kUnreachable, "no rig answers, or the link to it was lost (3xx)"},
      {ExitCode::kBadInput, "a file or a calibration is refused (1xx, 2xx)"},
      {ExitCode::kDevice, "a head or another device of the rig failed (4xx)"},
      {ExitCode::kStorage, "a file or a disk, here or on the rig (5xx)"},
      {ExitCode::kNotNow, "not possible now: the rig is in another state, or busy; later it may be (6xx)"},
      {ExitCode::kJudged,
       "the result of a check is negative: heads have moved, or the calibration that was tried is not better"},
      {ExitCode::kOutputLost, "standard output could not be written: full, or closed"},
      {ExitCode::kCannotTell, "a check has no result: the pictures do not show enough"},
      {ExitCode::kHungUp, "the terminal was closed (SIGHUP) before the work was done"},
      {ExitCode::kInterrupted, "Ctrl-C came before the work was done"},
      {ExitCode::kReaderGone, "the program that read standard output ended, as | head does"},
      {ExitCode::kTerminated, "SIGTERM came before the work was done"},
  }};
  return help;
}

}  // namespace nodal::host
