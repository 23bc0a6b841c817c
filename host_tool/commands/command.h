// Common to nodal's commands: shared options, the connection to a rig, and the command line that runs them.
#pragma once

#include <CLI/App.hpp>
#include <CLI/Validators.hpp>
#include <functional>
#include <map>
#include <memory>
#include <string>

#include "host_tool/console/console.h"
#include "host_tool/console/exit_code.h"
#include "host_tool/rig/rig_connection.h"
#include "protocol/base/result.h"
#include "protocol/base/units.h"

namespace nodal::host::look {
struct Prepared;
}

namespace nodal::host {

struct FoundRigs;

/// What a command needs to run: options, console, connection.
///
/// Threading: thread-bound.
/// Ownership: refers to the console.
/// Errors: those of RigConnection.
class Context {
 public:
  explicit Context(Console& console) : console_(console) {}

  Console& console() { return console_; }
  /// A new connection to the rig that --rig names.
  Result<std::unique_ptr<RigConnection>> connect();
  /// The rig that --rig names, else the environment. Errors: those of parse_rig_address().
  Result<RigAddress> address() const;
  /// Connects, sends one request, and disconnects.
  Result<wire::Reply> ask(const wire::Request& request);

  // Set from the command line before a command runs.
  std::string rig;
  std::string timeout = "10s";
  bool json = false;
  bool verbose = false;

  /// Opens the link of every connection.
  OpenLink open_link = host::open_link;

  /// If set, replaces connect(): tests connect over their own link.
  std::function<Result<std::unique_ptr<RigConnection>>()> connect_by;

  /// The socket and the browser of `look`, which are prepared before the process gives up its rights; null: not yet.
  std::shared_ptr<look::Prepared> page;

  /// What `rigs` found before the process gave up its rights; null: not yet.
  std::shared_ptr<FoundRigs> found_rigs;

  /// The exit code of a command that succeeded, but with a negative result.
  ExitCode answer = ExitCode::kOk;

 private:
  Console& console_;
};

using Action = std::function<Status(Context&)>;

/// The command line of `nodal`.
class CommandLine {
 public:
  using Add = void (*)(CLI::App& app, CommandLine& line);
  /// `add_commands` adds the commands: add_all_commands() of command_list.h.
  CommandLine(Console& console, Add add_commands);

  /// Parses and runs. The exit code also reports a failed standard output. Catches all exceptions.
  ExitCode run(int argc, const char* const* argv);

  /// If set, runs between the parsing of the words and the command; an error ends the run.
  std::function<Status(Context&, const CLI::App& command)> before_command;

  CLI::App& app() { return app_; }
  Context& context() { return context_; }
  /// Sets the action of `command`.
  void on(const CLI::App* command, Action action) { actions_[command] = std::move(action); }

 private:
  ExitCode parse_and_dispatch(int argc, const char* const* argv);
  ExitCode dispatch();
  /// Prints why the command line is refused, with --json as a document, too.
  ExitCode refuse_usage(const std::string& message);
  /// The exit code if standard output failed; prints a message on standard error, except if its reader closed the pipe.
  ExitCode with_lost_output(ExitCode code);

  Console& console_;
  Context context_;
  CLI::App app_;
  std::map<const CLI::App*, Action> actions_;
};

/// The index of a head given by name or index. The name has priority, because a head's name may be "2".
Result<std::uint32_t> find_head(const wire::Heads& heads, const std::string& name);

/// Prints a setting that the rig confirmed, with a warning if it will not survive a restart.
void show_setting(Console& console, Json document, const wire::Reply& reply);

/// Adds a command; its help text shows the examples below the options.
CLI::App* add_command(CLI::App& parent, const std::string& name, const std::string& description,
                      const std::string& examples);

/// Uses a parser as a check of an option's value, so that a refused value is a usage error that names the option.
template <class Parse>
CLI::Validator checked_by(Parse parse) {
  return CLI::Validator(
      [parse](std::string& text) {
        const auto value = parse(text);
        return value ? std::string() : value.error().message;
      },
      "", "");
}

}  // namespace nodal::host
