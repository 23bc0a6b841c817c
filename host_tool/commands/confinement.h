// What a command may do once its words are known: read its inputs, write beside its outputs, talk to its rig. What it
// reads (pictures, projects, takes, a rig's answers) may come from anywhere, and its readers may have faults.
#pragma once

#include <CLI/App.hpp>
#include <string>
#include <vector>

#include "host_tool/commands/command.h"
#include "protocol/base/result.h"

namespace nodal::host {

struct CommandRights {
  std::vector<std::string> read;     ///< files, and folders with everything beneath
  std::vector<std::string> write;    ///< folders of outputs
  std::vector<std::string> execute;  ///< programs
};

/// What an option's value names.
enum class PathUse { kNone, kInput, kOutputFile, kOutputFolder };
/// By the option's long name without "--"; positional arguments are inputs. Options that name no file are kNone.
PathUse path_use(const std::string& option);

/// Whether every output that the words name may be written, before a command works for it (console/overwriting.h).
/// Whether names with a number are free is seen when they are written. Errors: kExists; kNotFound for a folder that is
/// not there.
Status check_outputs(const CLI::App& command);

/// What the parsed command needs, without what every program needs.
CommandRights rights_of(const CLI::App& command);

/// Takes all other rights from this process, for the rest of its life, and gives `context` links that a helper process
/// opens. Call it before there are threads. A kernel that lacks a restriction goes without it; with `context.verbose`
/// standard error says what is in force. NODAL_CONFINE=off in the environment leaves everything permitted.
/// Errors: kIo if the kernel has a restriction and refuses to apply it.
Status confine_command(Context& context, const CLI::App& command);

}  // namespace nodal::host
