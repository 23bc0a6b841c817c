#include "protocol/command_line/usage.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <optional>
#include <regex>
#include <sstream>
#include <string_view>

#include "protocol/base/nearest_word.h"
#include "protocol/base/text.h"

namespace nodal {
namespace {

constexpr std::size_t kLongestWord = 60;  // bytes of what was typed, in a message

/// The command that was meant, as far as its words are commands.
const CLI::App& deepest(const CLI::App& app) {
  const CLI::App* chosen = &app;
  while (!chosen->get_subcommands().empty()) chosen = chosen->get_subcommands().front();
  return *chosen;
}

std::string full_name(const CLI::App& command) {
  const CLI::App* const parent = command.get_parent();
  return parent ? full_name(*parent) + " " + command.get_name() : command.get_name();
}

std::vector<std::string> commands_of(const CLI::App& command) {
  std::vector<std::string> names;
  for (const CLI::App* one : command.get_subcommands(nullptr)) names.push_back(one->get_name());
  return names;
}

/// The options of a command and, since they may stand after it too, those of the commands above it.
std::vector<std::string> options_of(const CLI::App& command) {
  std::vector<std::string> names;
  for (const CLI::App* one = &command; one; one = one->get_parent()) {
    for (const CLI::Option* option : one->get_options()) {
      for (const std::string& name : option->get_lnames()) names.push_back("--" + name);
    }
  }
  return names;
}

std::string nearest(const std::string& word, const std::vector<std::string>& known) {
  const std::vector<std::string_view> views(known.begin(), known.end());
  return std::string(nearest_word(word, views));
}

/// "-90.000000 to 0.001000" as "-90 to 0.001".
std::string without_zeros(const std::string& limits) {
  static const std::regex zeros(R"((\.\d*?)0+(?!\d))"), point(R"(\.(?!\d))");
  return std::regex_replace(std::regex_replace(limits, zeros, "$1"), point, "");
}

/// "--bits: 9 not in {8,16}" as "--bits: '9' is not one of 8, 16"; nothing if it is another message.
std::optional<std::string> about_choice(const std::string& text) {
  constexpr std::string_view kChoices = " not in {", kAfterName = ": ";
  const std::size_t value = text.find(kAfterName) + kAfterName.size(), choices = text.rfind(kChoices);
  if (choices == std::string::npos || !text.ends_with('}') || value > choices) return std::nullopt;
  const std::string typed = text.substr(value, choices - value);
  std::vector<std::string> allowed;
  std::istringstream list(text.substr(choices + kChoices.size(), text.size() - choices - kChoices.size() - 1));
  for (std::string one; std::getline(list, one, ',');) allowed.push_back(one);
  const std::string near = nearest(typed, allowed);
  return fmt::format("{}'{}' is not one of {}{}", text.substr(0, value), printable(typed, kLongestWord),
                     fmt::join(allowed, ", "), near.empty() ? "" : fmt::format("; did you mean '{}'?", near));
}

/// CLI11's message about a value, in plain words. Its versions write ranges as "-90.000000 to 90.000000" and as
/// "[-90 - 90]".
std::string about_value(std::string text) {
  constexpr std::string_view kConvert = "Could not convert: ", kIs = " = ", kValue = "Value ",
                             kRange = " not in range ", kTo = " - ";
  if (const std::size_t is = text.find(kIs); text.starts_with(kConvert) && is != std::string::npos) {
    return fmt::format("{}: '{}' is not a number", text.substr(kConvert.size(), is - kConvert.size()),
                       printable(text.substr(is + kIs.size()), kLongestWord));
  }
  if (const auto choice = about_choice(text)) return *choice;
  const std::size_t value = text.find(kValue), range = text.rfind(kRange);
  if (value == std::string::npos || range == std::string::npos || range < value + kValue.size()) return text;
  std::string limits = text.substr(range + kRange.size());
  if (const std::size_t to = limits.find(kTo);
      limits.starts_with("[") && limits.ends_with("]") && to != std::string::npos) {
    limits = fmt::format("{} to {}", limits.substr(1, to - 1), limits.substr(to + kTo.size(), limits.size() - to - 4));
  }
  const std::string typed = printable(text.substr(value + kValue.size(), range - value - kValue.size()), kLongestWord);
  return fmt::format("{}'{}' is not a number from {}", text.substr(0, value), typed, without_zeros(limits));
}

}  // namespace

std::vector<std::string> command_words(int argc, const char* const* argv) {
  std::vector<std::string> words(argv + std::min(argc, 1), argv + argc);
  if (!words.empty() && words.front() == "help") {
    words.erase(words.begin());
    words.push_back("--help");
  } else if (words.size() == 1 && words.front() == "version") {
    words.front() = "--version";
  }
  std::ranges::reverse(words);
  return words;
}

bool asks_for_json(int argc, const char* const* argv) {
  return std::find(argv, argv + argc, std::string_view("--json")) != argv + argc;
}

bool is_about_option(const Error& error) {
  return error.message.starts_with("--") && static_cast<int>(error.code) / 100 == 1;
}

std::string explain_usage(const CLI::App& app, const CLI::ParseError& wrong) {
  const bool incomplete = wrong.get_exit_code() == static_cast<int>(CLI::ExitCodes::RequiredError);
  const bool unknown = incomplete || wrong.get_exit_code() == static_cast<int>(CLI::ExitCodes::ExtrasError);
  const std::vector<std::string> rest = unknown ? app.remaining(true) : std::vector<std::string>{};
  if (rest.empty()) {
    const CLI::App& chosen = deepest(app);
    if (!incomplete || commands_of(chosen).empty() || !chosen.get_subcommands().empty()) {
      return about_value(wrong.what());
    }
    return fmt::format("`{}` needs a command: {}", full_name(chosen), fmt::join(commands_of(chosen), ", "));
  }
  const CLI::App& chosen = deepest(app);
  const std::string& word = rest.front();
  const std::string typed = printable(word, kLongestWord);
  const bool option = word.starts_with("-");
  const std::vector<std::string> known = option ? options_of(chosen) : commands_of(chosen);
  if (!option && known.empty()) return fmt::format("`{}` does not take the argument '{}'", full_name(chosen), typed);
  const std::string near = nearest(word.substr(0, word.find('=')), known);
  const std::string name = full_name(chosen);
  std::string text = option ? fmt::format("`{}` has no option '{}'", name, typed)
                            : fmt::format("there is no command `{} {}`", name, typed);
  if (!near.empty()) return fmt::format("{}; did you mean '{}'?", text, near);
  return option ? text : fmt::format("{}; there are {}", text, fmt::join(known, ", "));
}

std::string usage_hint(const CLI::App& app) {
  const CLI::App& chosen = deepest(app);
  const bool asks = !chosen.get_parent() && !commands_of(chosen).empty();
  return fmt::format("Run `{0} --help`{1}.", full_name(chosen),
                     asks ? fmt::format(", or `{} COMMAND --help`", full_name(chosen)) : "");
}

}  // namespace nodal
