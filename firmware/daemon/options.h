#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "firmware/daemon/log.h"
#include "protocol/base/result.h"

namespace nodal::daemon {

/// The parsed command line.
struct Options {
  std::string config;
  std::string store;   ///< empty: rig.toml's
  std::string socket;  ///< path of the socket that --bridge connects to; empty: the one in rig.toml
  bool check = false;
  bool bridge = false;
  bool safe_levels = false;
  bool scan = false;
  bool json = false;      ///< the scan is printed as JSON
  int blend_threads = 0;  ///< 0: one per core
  LogLevels log;
};

inline constexpr int kExitFine = 0;
inline constexpr int kExitFailed = 1;    ///< it failed while running
inline constexpr int kExitBadInput = 2;  ///< the command line or rig.toml is wrong
/// The store, a socket or a line cannot be opened, or no daemon answers the bridge.
inline constexpr int kExitCannotStart = 3;
inline constexpr int kExitStageHung = 4;  ///< a stage hung at the end; outputs were made safe, the end was by force

/// The options; or the exit code when there is nothing more to do: help was printed, or an error of the command line
/// was printed.
struct Parsed {
  Options options;
  std::optional<int> exit;
};
/// Writes a text to standard output; on a terminal, its lines are broken.
void show(std::string_view text);

Parsed parse_options(int argc, char** argv);

}  // namespace nodal::daemon
