// Shell completion scripts for `nodal`, generated from the command line itself so that they are always up to date.
#pragma once

#include <CLI/App.hpp>
#include <string>
#include <vector>

namespace nodal::host {

/// A command of the tree below an app: its words and its options.
struct CommandWords {
  std::vector<std::string> path;  ///< {"calibration", "upload"}; empty for `nodal` itself
  std::string description;
  std::vector<std::string> subcommands;
  struct Option {
    std::vector<std::string> names;  ///< {"-o", "--out"}
    std::string description;
    std::string value;  ///< "FILE", "jpg|png|raw"; empty for a flag
  };
  std::vector<Option> options;  ///< its own and those of all above it
  std::vector<std::string> positionals;
};

/// Every command, parents before children.
std::vector<CommandWords> command_words(const CLI::App& app);

std::string bash_completion(const std::vector<CommandWords>& commands);
std::string zsh_completion(const std::vector<CommandWords>& commands);
std::string fish_completion(const std::vector<CommandWords>& commands);

}  // namespace nodal::host
