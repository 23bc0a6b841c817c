#include "host_tool/commands/completion.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>

#include "host_tool/commands/command.h"

namespace nodal::host {
namespace {

void collect(const CLI::App& app, std::vector<std::string> path, std::vector<CommandWords::Option> inherited,
             std::vector<CommandWords>& all) {
  CommandWords words;
  words.path = path;
  words.description = app.get_description();
  words.options = std::move(inherited);
  const auto add_options = [&words](const CLI::App& from) {
    for (const CLI::Option* option : from.get_options()) {
      if (option->get_positional()) {
        words.positionals.push_back(option->get_name(true));
        continue;
      }
      CommandWords::Option entry;
      for (const std::string& name : option->get_snames()) entry.names.push_back(fmt::format("-{}", name));
      for (const std::string& name : option->get_lnames()) entry.names.push_back(fmt::format("--{}", name));
      entry.description = option->get_description();
      if (option->get_expected_max() > 0) entry.value = option->get_type_name();
      const bool known = std::ranges::any_of(
          words.options, [&](const CommandWords::Option& other) { return other.names == entry.names; });
      if (!known) words.options.push_back(std::move(entry));
    }
  };
  add_options(app);
  std::vector<const CLI::App*> children;
  for (const CLI::App* child : app.get_subcommands([](const CLI::App*) { return true; })) {
    if (child->get_name().empty()) {  // an option group
      add_options(*child);
    } else {
      words.subcommands.push_back(child->get_name());
      children.push_back(child);
    }
  }
  std::vector<CommandWords::Option> passed_on;
  for (const CommandWords::Option& option : words.options) {
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

std::vector<std::string> values_of(const std::string& value) {
  std::vector<std::string> values;
  if (value.find('|') == std::string::npos) return values;
  for (std::size_t start = 0; start <= value.size();) {
    const std::size_t bar = std::min(value.find('|', start), value.size());
    values.push_back(value.substr(start, bar - start));
    start = bar + 1;
  }
  return values;
}

/// In single quotes for every shell: a quote inside becomes the end of one string and the start of the next.
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
  std::string cases;
  std::string values;
  for (const CommandWords& command : commands) {
    std::vector<std::string> words = command.subcommands;
    for (const CommandWords::Option& option : command.options) {
      words.insert(words.end(), option.names.begin(), option.names.end());
      if (const auto choices = values_of(option.value); !choices.empty()) {
        values += fmt::format("    {}) COMPREPLY=($(compgen -W \"{}\" -- \"$current\")); return ;;\n",
                              fmt::join(option.names, "|"), fmt::join(choices, " "));
      }
    }
    cases += fmt::format("    \"{}\") words=\"{}\" ;;\n", fmt::join(command.path, " "), fmt::join(words, " "));
  }
  std::string names;
  for (const CommandWords& command : commands) {
    if (!command.path.empty()) names += fmt::format("      \"{}\") path=\"$try\" ;;\n", fmt::join(command.path, " "));
  }
  return "# bash completion for nodal:  source <(nodal completion bash)\n"
         "_nodal() {\n"
         "  local current=${COMP_WORDS[COMP_CWORD]} before=${COMP_WORDS[COMP_CWORD-1]} path= try word words=\n"
         "  for word in \"${COMP_WORDS[@]:1:COMP_CWORD-1}\"; do\n"
         "    try=\"${path:+$path }$word\"\n"
         "    case $try in\n" +
         names +
         "    esac\n"
         "  done\n"
         "  case $before in\n" +
         values +
         "  esac\n"
         "  case $path in\n" +
         cases +
         "  esac\n"
         "  COMPREPLY=($(compgen -W \"$words\" -- \"$current\"))\n"
         "  [[ $current == -* ]] || COMPREPLY+=($(compgen -f -- \"$current\"))\n"
         "}\n"
         "complete -o filenames -F _nodal nodal\n";
}

std::string zsh_completion(const std::vector<CommandWords>& commands) {
  std::string names;
  std::string cases;
  for (const CommandWords& command : commands) {
    if (!command.path.empty())
      names +=
          fmt::format("      ({}) where=\"$try\" ;;\n", shell_quoted(fmt::format("{}", fmt::join(command.path, " "))));
    std::string arguments;
    for (const CommandWords::Option& option : command.options) {
      for (const std::string& name : option.names) {
        std::string description = option.description;
        std::ranges::replace_if(
            description, [](char c) { return c == ':' || c == '[' || c == ']'; }, ' ');
        std::string spec = fmt::format("{}[{}]", name, description);
        if (const auto choices = values_of(option.value); !choices.empty()) {
          spec += fmt::format(":value:({})", fmt::join(choices, " "));
        } else if (!option.value.empty()) {
          spec += fmt::format(":{}:_files", option.value);
        }
        arguments += fmt::format(" {}", shell_quoted(spec));
      }
    }
    const std::string rest = command.subcommands.empty()
                                 ? shell_quoted("*:file:_files")
                                 : shell_quoted(fmt::format("*:command:({})", fmt::join(command.subcommands, " ")));
    cases += fmt::format("    ({}) _arguments{} {} ;;\n", shell_quoted(fmt::format("{}", fmt::join(command.path, " "))),
                         arguments, rest);
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
  std::string text =
      "# fish completion for nodal:  nodal completion fish > ~/.config/fish/completions/nodal.fish\n"
      "function __nodal_at\n"
      "  set -l words\n"
      "  for word in (commandline -opc)[2..-1]\n"
      "    string match -q -- '-*' $word; or set words $words $word\n"
      "  end\n"
      "  test \"$words\" = \"$argv\"; or test (count $argv) -gt 0 -a \"$words[1..(count $argv)]\" = \"$argv\"\n"
      "end\n";
  for (const CommandWords& command : commands) {
    const std::string at = shell_quoted(fmt::format("__nodal_at {}", fmt::join(command.path, " ")));
    for (const std::string& name : command.subcommands) {
      const auto child = std::ranges::find_if(commands, [&](const CommandWords& other) {
        return other.path.size() == command.path.size() + 1 && other.path.back() == name &&
               std::equal(command.path.begin(), command.path.end(), other.path.begin());
      });
      text += fmt::format("complete -c nodal -n {} -f -a {} -d {}\n", at, name, shell_quoted(child->description));
    }
    for (const CommandWords::Option& option : command.options) {
      text += fmt::format("complete -c nodal -n {}", at);
      for (const std::string& name : option.names) {
        text += name.starts_with("--") ? fmt::format(" -l {}", name.substr(2)) : fmt::format(" -s {}", name.substr(1));
      }
      if (const auto choices = values_of(option.value); !choices.empty()) {
        text += fmt::format(" -x -a '{}'", fmt::join(choices, " "));
      } else if (!option.value.empty()) {
        text += " -r";
      }
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
      ->type_name("")
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
