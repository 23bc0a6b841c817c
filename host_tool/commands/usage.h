// Messages for command lines that are not understood.
#pragma once

#include <CLI/App.hpp>
#include <string>
#include <vector>

namespace nodal::host {

/// The words of a command line, last one first as CLI11 takes them: `help COMMAND` as `COMMAND --help`, `version` as
/// `--version`, the rest as they are. argv[0] is left out.
std::vector<std::string> command_words(int argc, const char* const* argv);

/// One sentence about why `app` did not take the words: names the command or option that is not there and the nearest one
/// that is, or says what the error says.
std::string explain_usage(const CLI::App& app, const CLI::ParseError& wrong);

/// "Run `nodal COMMAND --help`." for the command that was meant, as far as it was understood.
std::string usage_hint(const CLI::App& app);

}  // namespace nodal::host
