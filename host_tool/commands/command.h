// Common to nodal's commands: shared options, the connection to a rig, and the table of commands that main, completion
// and the manual page's test read.
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

namespace nodal::host {

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

  /// The exit code of a command that succeeded, but with a negative result.
  ExitCode answer = ExitCode::kOk;

 private:
  Console& console_;
};

using Action = std::function<Status(Context&)>;

/// All of `nodal`'s command line.
class CommandLine {
 public:
  explicit CommandLine(Console& console);

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

// One function per file; each adds its command below `app` and registers its action.
void add_status(CLI::App& app, CommandLine& line);
void add_heads(CLI::App& app, CommandLine& line);
void add_hosts(CLI::App& app, CommandLine& line);
void add_exposure(CLI::App& app, CommandLine& line);
void add_genlock(CLI::App& app, CommandLine& line);
void add_calibration(CLI::App& app, CommandLine& line);
void add_take(CLI::App& app, CommandLine& line);
void add_offload(CLI::App& app, CommandLine& line);
void add_disk(CLI::App& app, CommandLine& line);
void add_audit(CLI::App& app, CommandLine& line);
void add_sync(CLI::App& app, CommandLine& line);
void add_raymap(CLI::App& app, CommandLine& line);
void add_import(CLI::App& app, CommandLine& line);
void add_pairs(CLI::App& app, CommandLine& line);
void add_drift(CLI::App& app, CommandLine& line);
void add_register(CLI::App& app, CommandLine& line);
void add_stitch(CLI::App& app, CommandLine& line);
void add_render(CLI::App& app, CommandLine& line);
void add_convert(CLI::App& app, CommandLine& line);
void add_view(CLI::App& app, CommandLine& line);
void add_mesh(CLI::App& app, CommandLine& line);
void add_export(CLI::App& app, CommandLine& line);
void add_pattern(CLI::App& app, CommandLine& line);
void add_calibrate(CLI::App& app, CommandLine& line);
/// `heads latency`, below `heads`.
void add_latency(CLI::App& heads, CommandLine& line);
/// `calibration diff`, below `calibration`.
void add_calibration_diff(CLI::App& group, CommandLine& line);
/// `calibrate light`, below `calibrate`.
void add_calibrate_light(CLI::App& group, CommandLine& line);
/// `take verify`, below `take`.
void add_take_export(CLI::App& group, CommandLine& line);
void add_take_show(CLI::App& group, CommandLine& line);
void add_take_verify(CLI::App& group, CommandLine& line);
void add_completion(CLI::App& app, CommandLine& line);

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
