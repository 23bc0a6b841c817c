// The text of --help, the same for both programs.
#pragma once

#include <CLI/App.hpp>
#include <CLI/Formatter.hpp>
#include <string>

namespace nodal {

/// An option's type as the commands name it ("sum|max", "PX"), without the checks that CLI11 appends (":{max,sum}"),
/// and without the values that a command lists for completion only ("NAME:cube|healpix").
std::string type_of(const CLI::Option& option);

/// CLI11's help, with types as the options name them, ranges in words, and without lists of excluded options.
class PlainHelp final : public CLI::Formatter {
 public:
  std::string make_option_opts(const CLI::Option* option) const override;
};

}  // namespace nodal
