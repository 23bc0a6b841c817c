// Runs a program in a terminal of its own, as a person does.
#pragma once

#include <chrono>
#include <cstddef>
#include <map>
#include <string>
#include <vector>

namespace nodal::test {

/// What a program wrote to its terminal.
struct Shown {
  int code = -1;  ///< exit code, or 128 + the signal that ended it
  std::string text;
};

struct Terminal {
  unsigned short columns = 80, rows = 24;
  std::string typed{};  ///< what a person types, at once
  std::chrono::seconds at_most = std::chrono::seconds(120);
};

/// Runs a command in a new terminal, which is its input, output and error, and waits for its end; kills it (code 137)
/// after `at_most`. `environment` is added to ours.
Shown run_in_terminal(const std::vector<std::string>& command, const std::map<std::string, std::string>& environment,
                      const Terminal& like = {});

/// The widest line of what a terminal was sent, in characters: escape sequences have no width, and after a carriage
/// return the line begins again.
std::size_t widest_line(const std::string& text);

}  // namespace nodal::test
