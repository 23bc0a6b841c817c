#include "firmware/daemon/options.h"

#include <unistd.h>

#include <CLI/CLI.hpp>
#include <cstdio>
#include <iostream>
#include <sstream>

#include "firmware/daemon/version.h"
#include "protocol/base/fit_text.h"

namespace nodal::daemon {
namespace {

constexpr const char* kAbout =
    "nodald runs a multi-head camera rig: it sets every head's exposure, genlocks and captures the heads, blends them "
    "into one raymap and sends that to hosts.\n"
    "rig.toml describes the rig; firmware/RIG.md explains every key.";

constexpr const char* kFooter =
    "\nExamples:\n"
    "  nodald --config /etc/nodal/rig.toml\n"
    "  nodald --config rig.toml --check           check rig.toml, print the first error, and stop\n"
    "  nodald --config rig.toml --store ./store   store calibrations and settings in this folder\n"
    "  nodald --scan > rig.toml                   list the devices; begin a rig.toml with them\n"
    "  ssh rig nodald --bridge                    connect standard input and output to the nodald that runs on rig\n"
    "\n"
    "SIGTERM and SIGINT end it cleanly. Exit codes: 0 fine, 1 failed while running, 2 command line or rig.toml wrong, "
    "3 cannot start, 4 a stage hung at the end.";

}  // namespace

void show(std::string_view text) {
  const std::string shown = ::isatty(STDOUT_FILENO) == 1 ? fitted(text) : std::string(text);
  std::fwrite(shown.data(), 1, shown.size(), stdout);
}

Parsed parse_options(int argc, char** argv) {
  Parsed parsed;
  Options& options = parsed.options;
  CLI::App app(kAbout, "nodald");
  app.footer(kFooter);
  app.set_version_flag("--version", kSoftware);
  app.add_option("--config,-c", options.config, "The rig: a rig.toml")->type_name("FILE");
  app.add_option("--store", options.store, "Folder of the calibration store, instead of rig.toml's")->type_name("DIR");
  app.add_option("--blend-threads", options.blend_threads, "Number of threads that blend; default: one per core")
      ->check(CLI::Range(1, 64))
      ->type_name("N");
  app.add_option_function<std::string>(
         "--log",
         [&options](const std::string& text) {
           const Result<LogLevels> levels = LogLevels::parse(text);
           if (!levels) throw CLI::ValidationError(levels.error().message);
           options.log = *levels;
         },
         "Level of the log on standard error: trace, debug, info, warning, error; or of one category, such as "
         "capture=debug,v4l2=trace (rig, capture, v4l2, iidc, gpio): what heads do, and every call to a driver")
      ->type_name("LEVELS");
  CLI::Option* check =
      app.add_flag("--check", options.check, "Check rig.toml and the files and devices it names, and stop");
  app.add_flag("--bridge", options.bridge, "Connect standard input and output to the running nodald's socket")
      ->excludes(check);
  app.add_flag("--safe-levels", options.safe_levels,
               "Put the GPIO outputs of rig.toml to their safe levels, and stop; for after a crash")
      ->excludes(check)
      ->excludes("--bridge");
  CLI::Option* scan =
      app.add_flag(
             "--scan", options.scan,
             "Print the V4L2 devices and IIDC cameras that are plugged in, and a rig.toml, and stop; changes no device")
          ->excludes(check)
          ->excludes("--bridge")
          ->excludes("--safe-levels");
  app.add_flag("--json", options.json, "With --scan: as JSON")->needs(scan);
  app.add_option("--socket", options.socket, "Socket for --bridge, instead of rig.toml's")->type_name("PATH");
  try {
    app.parse(argc, argv);
    if (options.config.empty() && !options.bridge && !options.scan) throw CLI::RequiredError("--config FILE");
  } catch (const CLI::ParseError& error) {
    const bool asked = error.get_exit_code() == 0;
    std::ostringstream out;
    app.exit(error, out, std::cerr);
    show(out.str());
    parsed.exit = asked ? kExitFine : kExitBadInput;
  }
  return parsed;
}

}  // namespace nodal::daemon
