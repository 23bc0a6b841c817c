#include "firmware/daemon/options.h"

#include <unistd.h>

#include <CLI/CLI.hpp>
#include <cstdio>
#include <iostream>
#include <memory>
#include <sstream>

#include "firmware/daemon/rig_reference.h"
#include "firmware/daemon/version.h"
#include "protocol/base/fit_text.h"
#include "protocol/command_line/plain_help.h"
#include "protocol/command_line/usage.h"

namespace nodal::daemon {
namespace {

constexpr const char* kAbout =
    "Runs a camera rig: sets the cameras' exposure, takes their pictures together, blends them into one and records.\n"
    "A rig.toml describes the rig: nodald --scan writes one, and nodald --explain explains every key.";

constexpr const char* kFooter =
    "\nExamples:\n"
    "  nodald rig.toml\n"
    "  nodald rig.toml --check                    check rig.toml, print the first error, and stop\n"
    "  nodald rig.toml --store ./store            store calibrations and settings in this folder\n"
    "  nodald --scan > rig.toml                   list the devices; begin a rig.toml with them\n"
    "  nodald --explain takes.mode                explain a key of rig.toml; takes: a section and its keys\n"
    "  ssh rig nodald --bridge                    connect standard input and output to the nodald that runs on rig\n"
    "\n"
    "SIGTERM and SIGINT end it cleanly. Exit codes: 0 fine, 1 failed while running, 2 command line or rig.toml wrong, "
    "3 cannot start, 4 a stage hung at the end.";

/// Prints what RIG.md says about a key or section, or that there is none; the exit code.
int explain_key(const std::string& key) {
  const Result<std::string> text = explain(kRigReference, key);
  if (text) show(*text);
  else std::cerr << "nodald: " << text.error().message << '\n';
  return text ? kExitFine : kExitBadInput;
}

}  // namespace

void show(std::string_view text) {
  const std::string shown = ::isatty(STDOUT_FILENO) == 1 ? fitted(text) : std::string(text);
  std::fwrite(shown.data(), 1, shown.size(), stdout);
}

Parsed parse_options(int argc, char** argv) {
  Parsed parsed;
  Options& options = parsed.options;
  std::string key;  // a key or section of rig.toml
  CLI::App app(kAbout, "nodald");
  app.formatter(std::make_shared<PlainHelp>());
  app.footer(kFooter);
  app.set_help_flag("-h,--help", "Print this help and exit");
  app.set_version_flag("-V,--version", kSoftware, "Print the version and exit");
  app.add_option("-c,--config,RIG_TOML", options.config, "The rig: a rig.toml")->type_name("FILE");
  app.add_option("--store", options.store, "Folder of calibrations and settings, instead of rig.toml's")
      ->type_name("DIR");
  app.add_option("--blend-threads", options.blend_threads,
                 "Number of threads that blend (one for each core when not given)")
      ->check(CLI::Range(1, 64))
      ->type_name("N");
  app.add_option_function<std::string>(
         "--log",
         [&options](const std::string& text) {
           const Result<LogLevels> levels = LogLevels::parse(text);
           if (!levels) throw CLI::ValidationError(levels.error().message);
           options.log = *levels;
         },
         "How much the log on standard error says: error, warning, info, debug or trace, of all or of a category\n"
         "(rig, capture, v4l2, iidc, gpio): capture=debug,v4l2=trace says what heads do, and every call to a driver")
      ->type_name("LEVELS");
  CLI::Option* check =
      app.add_flag("--check", options.check, "Check rig.toml, and the files and devices that it names");
  app.add_flag("--bridge", options.bridge, "Connect standard input and output to the socket of the nodald that runs")
      ->excludes(check);
  app.add_flag("--safe-levels", options.safe_levels,
               "Put the GPIO outputs of rig.toml to their safe levels, after a crash")
      ->excludes(check)
      ->excludes("--bridge");
  CLI::Option* scan = app.add_flag("--scan", options.scan,
                                   "Print the cameras that are plugged in, and a rig.toml for them; changes no device")
                          ->excludes(check)
                          ->excludes("--bridge")
                          ->excludes("--safe-levels");
  app.add_option("--explain", key, "Explain a key or a section of rig.toml: takes.mode, takes")
      ->type_name("KEY")
      ->excludes(check)
      ->excludes("--bridge")
      ->excludes("--safe-levels")
      ->excludes(scan);
  app.add_flag("--json", options.json, "With --scan: as JSON")->needs(scan);
  app.add_option("--socket", options.socket, "The socket for --bridge, instead of rig.toml's")->type_name("PATH");
  try {
    app.parse(argc, argv);
    if (options.config.empty() && !options.bridge && !options.scan && key.empty())
      throw CLI::RequiredError("a rig.toml");
    if (!key.empty()) parsed.exit = explain_key(key);
  } catch (const CLI::Success& asked) {
    std::ostringstream out;
    app.exit(asked, out, std::cerr);
    show(out.str());
    parsed.exit = kExitFine;
  } catch (const CLI::ParseError& wrong) {
    std::cerr << "nodald: " << explain_usage(app, wrong) << '\n' << usage_hint(app) << '\n';
    parsed.exit = kExitBadInput;
  }
  return parsed;
}

}  // namespace nodal::daemon
