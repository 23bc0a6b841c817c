#pragma once

#include <optional>
#include <string>

#include "protocol/base/result.h"

namespace nodal::daemon {

/// What the command line says.
struct Options {
  std::string config;
  std::string store;   ///< empty: what rig.toml says
  std::string socket;  ///< bridge: empty: what rig.toml says
  bool check = false;
  bool bridge = false;
  int blend_threads = 0;  ///< 0: one a core
  std::string log_level = "info";
};

inline constexpr int kExitFine = 0;
inline constexpr int kExitFailed = 1;       ///< it ran, and had to give up
inline constexpr int kExitBadInput = 2;     ///< the command line or rig.toml is wrong
inline constexpr int kExitCannotStart = 3;  ///< the store or a socket cannot be had, or no daemon answers the bridge
inline constexpr int kExitStageHung = 4;  ///< asked to end, a stage hung; outputs were made safe and it ended by force

/// The options, or the exit code when there is nothing more to do: help was asked for, or the line was wrong and has
/// been told so.
struct Parsed {
  Options options;
  std::optional<int> exit;
};
Parsed parse_options(int argc, char** argv);

}  // namespace nodal::daemon
