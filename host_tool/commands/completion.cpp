#include "host_tool/commands/completion.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <string_view>

#include "host_tool/commands/command.h"
#include "host_tool/commands/command_list.h"
#include "protocol/command_line/plain_help.h"

namespace nodal::host {
namespace {

using Value = CommandWords::Value;

/// The values for an option's type ("FILE", "jpg|png|raw", "NAME:jpg|png|raw") or an argument's name ("PICTURES").
Value value_of(const std::string& whole) {
  constexpr std::array<std::string_view, 9> kFiles{"FILE",   "HTML",        "PATTERN", "INPUT", "PICTURES",
                                                   "PHOTOS", "CALIBRATION", "A",       "B"};
  Value value;
  std::string list = whole.substr(0, whole.find(':'));
  value.file = std::ranges::find(kFiles, list) != kFiles.end();
  if (list.size() < whole.size() && list.find('|') == std::string::npos) {
    list = whole.substr(list.size() + 1);
    list.resize(std::min(list.find(':'), list.size()));
  }
  if (list.find('|') == std::string::npos) return value;
  for (std::size_t start = 0; start <= list.size();) {
    const std::size_t bar = std::min(list.find('|', start), list.size());
    const std::string word = list.substr(start, bar - start);
    // A word in capitals stands for values: "N|best", "SHAPE|FILE".
    if (word == "FILE") value.file = true;
    if (std::ranges::none_of(word, [](char c) { return c >= 'A' && c <= 'Z'; })) value.choices.push_back(word);
    start = bar + 1;
  }
  return value;
}

void add_option(CommandWords& words, const CLI::Option& option) {
  if (option.get_positional()) {
    const bool named = type_of(option).empty();
    const Value value = value_of(named ? option.get_name(true) : option.get_type_name());
    words.positional.file = words.positional.file || value.file;
    words.positional.choices.insert(words.positional.choices.end(), value.choices.begin(), value.choices.end());
    return;
  }
  CommandWords::Option entry;
  for (const std::string& name : option.get_snames()) entry.names.push_back(fmt::format("-{}", name));
  for (const std::string& name : option.get_lnames()) entry.names.push_back(fmt::format("--{}", name));
  entry.description = option.get_description();
  if (option.get_expected_max() > 0) entry.type = type_of(option);
  if (!entry.type.empty()) entry.value = value_of(option.get_type_name());
  const bool known =
      std::ranges::any_of(words.options, [&](const CommandWords::Option& other) { return other.names == entry.names; });
  if (!known) words.options.push_back(std::move(entry));
}

void collect(const CLI::App& app, std::vector<std::string> path, const std::vector<CommandWords::Option>& inherited,
             std::vector<CommandWords>& all) {
  CommandWords words;
  words.path = path;
  words.description = app.get_description();
  words.runs = app.get_require_subcommand_min() == 0;
  words.options = inherited;
  for (const CLI::Option* option : app.get_options()) add_option(words, *option);
  std::vector<const CLI::App*> children;
  for (const CLI::App* child : app.get_subcommands([](const CLI::App*) { return true; })) {
    if (child->get_name().empty()) {  // an option group
      for (const CLI::Option* option : child->get_options()) add_option(words, *option);
    } else {
      words.subcommands.push_back(child->get_name());
      children.push_back(child);
    }
  }
  // Options of a command that runs without a subcommand are its own.
  std::vector<CommandWords::Option> passed_on;
  for (const CommandWords::Option& option : words.runs ? inherited : words.options) {
    const bool only_here = std::ranges::find(option.names, "--version") != option.names.end();
    if (!only_here) passed_on.push_back(option);
  }
  all.push_back(std::move(words));
  for (const CLI::App* child : children) {
    std::vector<std::string> child_path = path;
    child_path.push_back(child->get_name());
    collect(*child, child_path, passed_on, all);
  }
}

/// "raymap pull"; empty for `nodal` itself.
std::string path_of(const CommandWords& command) { return fmt::format("{}", fmt::join(command.path, " ")); }

/// In single quotes, which all shells understand: a quote inside ends one string and starts the next.
std::string shell_quoted(const std::string& text) {
  std::string out = "'";
  for (const char c : text) {
    if (c == '\'') {
      out += "'\\''";
    } else {
      out += c;
    }
  }
  out += '\'';
  return out;
}

}  // namespace

std::vector<CommandWords> command_words(const CLI::App& app) {
  std::vector<CommandWords> all;
  collect(app, {}, {}, all);
  return all;
}

std::string bash_completion(const std::vector<CommandWords>& commands) {
  std::string names;
  std::string values;
  std::string cases;
  for (const CommandWords& command : commands) {
    const std::string path = path_of(command);
    if (!path.empty()) names += fmt::format("      \"{}\") path=\"$try\" ;;\n", path);
    std::vector<std::string> words = command.subcommands;
    for (const CommandWords::Option& option : command.options) {
      words.insert(words.end(), option.names.begin(), option.names.end());
      if (option.type.empty()) continue;
      std::vector<std::string> patterns;
      for (const std::string& name : option.names) patterns.push_back(fmt::format("\"{} {}\"", path, name));
      const std::string offer =
          option.value.file ? "-f" : fmt::format("-W \"{}\"", fmt::join(option.value.choices, " "));
      values += fmt::format("    {}) COMPREPLY=($(compgen {} -- \"$current\")); return ;;\n", fmt::join(patterns, "|"),
                            offer);
    }
    words.insert(words.end(), command.positional.choices.begin(), command.positional.choices.end());
    cases += fmt::format("    \"{}\") words=\"{}\" files={} ;;\n", path, fmt::join(words, " "),
                         command.positional.file ? "1" : "");
  }
  return "# bash completion for nodal:  source <(nodal completion bash)\n"
         "_nodal() {\n"
         "  local current=${COMP_WORDS[COMP_CWORD]} before=${COMP_WORDS[COMP_CWORD-1]} path= try word words= files=\n"
         "  for word in \"${COMP_WORDS[@]:1:COMP_CWORD-1}\"; do\n"
         "    try=\"${path:+$path }$word\"\n"
         "    case $try in\n" +
         names +
         "    esac\n"
         "  done\n"
         "  case \"$path $before\" in\n" +
         values +
         "  esac\n"
         "  case $path in\n" +
         cases +
         "  esac\n"
         "  COMPREPLY=($(compgen -W \"$words\" -- \"$current\"))\n"
         "  [[ -z $files || $current == -* ]] || COMPREPLY+=($(compgen -f -- \"$current\"))\n"
         "}\n"
         "complete -o filenames -F _nodal nodal\n";
}

std::string zsh_completion(const std::vector<CommandWords>& commands) {
  std::string names;
  std::string cases;
  const auto offered = [](const Value& value) {
    if (value.file) return std::string("_files");
    return value.choices.empty() ? std::string(" ") : fmt::format("({})", fmt::join(value.choices, " "));
  };
  for (const CommandWords& command : commands) {
    const std::string path = shell_quoted(path_of(command));
    if (!command.path.empty()) names += fmt::format("      ({}) where=\"$try\" ;;\n", path);
    std::string arguments;
    for (const CommandWords::Option& option : command.options) {
      for (const std::string& name : option.names) {
        std::string description = option.description;
        std::ranges::replace_if(
            description, [](char c) { return c == ':' || c == '[' || c == ']'; }, ' ');
        std::string spec = fmt::format("{}[{}]", name, description);
        if (!option.type.empty()) spec += fmt::format(":value:{}", offered(option.value));
        arguments += fmt::format(" {}", shell_quoted(spec));
      }
    }
    const std::string rest = command.subcommands.empty()
                                 ? fmt::format("*:argument:{}", offered(command.positional))
                                 : fmt::format("*:command:({})", fmt::join(command.subcommands, " "));
    cases += fmt::format("    ({}) _arguments{} {} ;;\n", path, arguments, shell_quoted(rest));
  }
  return "#compdef nodal\n"
         "# zsh completion for nodal:  nodal completion zsh > ~/.zfunc/_nodal\n"
         "_nodal() {\n"
         "  local where= try word\n"
         "  for word in \"${words[@]:1:$((CURRENT-2))}\"; do\n"
         "    try=\"${where:+$where }$word\"\n"
         "    case $try in\n" +
         names +
         "    esac\n"
         "  done\n"
         "  case $where in\n" +
         cases +
         "  esac\n"
         "}\n"
         "if [ \"${funcstack[1]}\" = _nodal ]; then _nodal \"$@\"; else compdef _nodal nodal; fi\n";
}

std::string fish_completion(const std::vector<CommandWords>& commands) {
  std::vector<std::string> paths;
  for (const CommandWords& command : commands) {
    if (!command.path.empty()) paths.push_back(shell_quoted(path_of(command)));
  }
  std::string text =
      "# fish completion for nodal:  nodal completion fish > ~/.config/fish/completions/nodal.fish\n"
      "function __nodal_at\n"
      "  set -l path ''\n"
      "  for word in (commandline -opc)[2..-1]\n"
      "    set -l try (string trim -- \"$path $word\")\n"
      "    contains -- \"$try\" " +
      fmt::format("{}", fmt::join(paths, " ")) +
      "; and set path \"$try\"\n"
      "  end\n"
      "  test \"$path\" = \"$argv\"\n"
      "end\n"
      "complete -c nodal -f\n";
  const auto offered = [](const Value& value) {
    if (value.file) return std::string(" -F");
    return value.choices.empty() ? std::string() : fmt::format(" -a '{}'", fmt::join(value.choices, " "));
  };
  for (const CommandWords& command : commands) {
    const std::string at = shell_quoted(fmt::format("__nodal_at {}", path_of(command)));
    for (const std::string& name : command.subcommands) {
      const auto child = std::ranges::find_if(commands, [&](const CommandWords& other) {
        return other.path.size() == command.path.size() + 1 && other.path.back() == name &&
               std::equal(command.path.begin(), command.path.end(), other.path.begin());
      });
      text += fmt::format("complete -c nodal -n {} -a {} -d {}\n", at, name, shell_quoted(child->description));
    }
    if (const std::string more = offered(command.positional); !more.empty()) {
      text += fmt::format("complete -c nodal -n {}{}\n", at, more);
    }
    for (const CommandWords::Option& option : command.options) {
      text += fmt::format("complete -c nodal -n {}", at);
      for (const std::string& name : option.names) {
        text += name.starts_with("--") ? fmt::format(" -l {}", name.substr(2)) : fmt::format(" -s {}", name.substr(1));
      }
      if (!option.type.empty()) text += (option.value.file ? " -r" : " -x") + offered(option.value);
      text += fmt::format(" -d {}\n", shell_quoted(option.description));
    }
  }
  return text;
}

void add_completion(CLI::App& app, CommandLine& line) {
  CLI::App* command = add_command(app, "completion", "Print a script that makes a shell complete `nodal`",
                                  "  source <(nodal completion bash)\n"
                                  "  nodal completion zsh > ~/.zfunc/_nodal\n"
                                  "  nodal completion fish > ~/.config/fish/completions/nodal.fish\n");
  auto shell = std::make_shared<std::string>();
  command->add_option("SHELL", *shell, "bash, zsh or fish")
      ->required()
      ->type_name("bash|zsh|fish")
      ->check(CLI::IsMember({"bash", "zsh", "fish"}, CLI::ignore_case));
  line.on(command, [shell, &app](Context& context) -> Status {
    const std::vector<CommandWords> words = command_words(app);
    const std::string script = *shell == "bash"  ? bash_completion(words)
                               : *shell == "zsh" ? zsh_completion(words)
                                                 : fish_completion(words);
    context.console().document({{"shell", *shell}, {"script", script}});
    if (!context.console().json()) context.console().bytes(script);
    return {};
  });
}

}  // namespace nodal::host
