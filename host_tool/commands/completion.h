// Shell completion scripts for `nodal`, generated from the command line's definition so that they are always current.
#pragma once

#include <CLI/App.hpp>
#include <string>
#include <vector>

namespace nodal::host {

/// A command of the tree below an app: its words and its options.
struct CommandWords {
  /// The possible values of an option or argument.
  struct Value {
    std::vector<std::string> choices;  ///< all of them; empty if they cannot be listed
    bool file = false;                 ///< the name of a file or folder
  };
  std::vector<std::string> path;  ///< {"calibration", "upload"}; empty for `nodal` itself
  std::string description;
  std::vector<std::string> subcommands;
  bool runs = false;  ///< without a subcommand
  struct Option {
    std::vector<std::string> names;  ///< {"-o", "--out"}
    std::string description;
    std::string type;  ///< "FILE", "jpg|png|raw"; empty for a flag
    Value value;
  };
  std::vector<Option> options;  ///< its own and those of its parents
  Value positional;             ///< value of its positional arguments
};

/// Every command, parents before children.
std::vector<CommandWords> command_words(const CLI::App& app);

std::string bash_completion(const std::vector<CommandWords>& commands);
std::string zsh_completion(const std::vector<CommandWords>& commands);
std::string fish_completion(const std::vector<CommandWords>& commands);

}  // namespace nodal::host
