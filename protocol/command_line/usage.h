// Messages for command lines that are not understood.
#pragma once

#include <CLI/App.hpp>
#include <string>
#include <vector>

#include "protocol/base/result.h"

namespace nodal {

/// The words of a command line, last word first as CLI11 expects. `help COMMAND` becomes `COMMAND --help`, `version`
/// becomes `--version`, other words are unchanged. argv[0] is left out.
std::vector<std::string> command_words(int argc, const char* const* argv);

/// Whether the words contain --json, also when the rest of them cannot be understood.
bool asks_for_json(int argc, const char* const* argv);

/// Whether a command refuses the value of an option: the message begins with the option's name, and the number is of
/// 1xx. Such a value is a usage error, whether it is refused before the command runs or by it.
bool is_about_option(const Error& error);

/// One sentence about why `app` refused the words: it names the unknown command or option and the nearest known one, or
/// gives the error's own message.
std::string explain_usage(const CLI::App& app, const CLI::ParseError& wrong);

/// "Run `nodal COMMAND --help`." for the intended command, as far as it was recognized, or for the program.
std::string usage_hint(const CLI::App& app);

}  // namespace nodal
