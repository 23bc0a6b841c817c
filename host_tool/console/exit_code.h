// nodal's exit codes. Scripts depend on these numbers: they are never renumbered.
#pragma once

#include <array>
#include <string_view>

#include "protocol/base/result.h"

namespace nodal::host {

enum class ExitCode : int {
  kOk = 0,
  kFailed = 1,       ///< an internal error of Nodal (9xx), or no other code fits
  kUsage = 2,        ///< invalid command line, or a wrong value of an option
  kUnreachable = 3,  ///< no rig, or the link to it was lost (3xx)
  kBadInput = 4,     ///< a file or calibration is refused (1xx, 2xx)
  kDevice = 5,       ///< a head or another device of the rig (4xx)
  kStorage = 6,      ///< a file or disk, here or on the rig (5xx)
  kNotNow = 7,       ///< the right request at the wrong moment (6xx)
  kJudged = 8,       ///< the command judges something, and the result is negative: drifted, not better
  kOutputLost = 9,   ///< standard output could not be written
  kCannotTell = 10,  ///< the command judges something, and what it was given does not determine the result
  // 128 + the signal's number, as shells report a program that a signal ended.
  kHungUp = 129,       ///< the terminal was closed (SIGHUP) before the work was done
  kInterrupted = 130,  ///< Ctrl-C (SIGINT) before the work was done
  kReaderGone = 141,   ///< the reader of standard output closed the pipe (SIGPIPE), as `| head` does
  kTerminated = 143,   ///< SIGTERM before the work was done
};

/// Whether the command did what it was asked to, whatever it found.
bool answered(ExitCode code);
/// By the hundreds of the error number.
ExitCode exit_code_of(Errc code);
/// Exit code of a command that this signal stopped: 128 + signal, also without a name above.
ExitCode exit_code_of_signal(int signal);

struct ExitCodeHelp {
  ExitCode code;
  std::string_view meaning;
};
/// All codes, each with one line for --help and the manual page.
const std::array<ExitCodeHelp, 15>& exit_code_help();

}  // namespace nodal::host
