#include "host_tool/exit_code.h"

namespace nodal::host {

ExitCode exit_code_of(Errc code) {
  if (code == Errc::kBusy) return ExitCode::kNotNow;  // the link is fine; somebody else was first
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

const std::array<ExitCodeHelp, 9>& exit_code_help() {
  static const std::array<ExitCodeHelp, 9> help{{
      {ExitCode::kOk, "done"},
      {ExitCode::kFailed, "Nodal itself went wrong (errors 9xx)"},
      {ExitCode::kUsage, "the command line cannot be understood"},
      {ExitCode::kUnreachable, "no rig answers, or the link to it was lost (3xx)"},
      {ExitCode::kBadInput, "a file, a value or a calibration is refused (1xx, 2xx)"},
      {ExitCode::kDevice, "a head or another device of the rig failed (4xx)"},
      {ExitCode::kStorage, "a file or a disk, here or on the rig (5xx)"},
      {ExitCode::kNotNow, "the right request at the wrong moment (6xx, busy)"},
      {ExitCode::kJudged, "asked to judge, and the answer is no: heads have moved, or a trial was no better"},
  }};
  return help;
}

}  // namespace nodal::host
