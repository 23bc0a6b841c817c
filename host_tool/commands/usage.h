// Messages for command lines that are not understood.
#pragma once

#include <CLI/App.hpp>
#include <string>
#include <vector>

namespace nodal::host {

/// The words of a command line, last word first as CLI11 expects. `help COMMAND` becomes `COMMAND --help`, `version`
/// becomes `--version`, other words are unchanged. argv[0] is left out.
std::vector<std::string> command_words(int argc, const char* const* argv);

/// One sentence about why `app` refused the words: it names the unknown command or option and the nearest known one, or
/// gives the error's own message.
std::string explain_usage(const CLI::App& app, const CLI::ParseError& wrong);

/// "Run `nodal COMMAND --help`." for the intended command, as far as it was recognized.
std::string usage_hint(const CLI::App& app);

}  // namespace nodal::host
