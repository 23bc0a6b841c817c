#include "host_tool/commands/command.h"

#include <fmt/format.h>
#include <CLI/Config.hpp>

#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <memory>
#include <new>
#include <sstream>

#include "host_tool/commands/confinement.h"
#include "host_tool/console/interrupt.h"
#include "host_tool/console/overwriting.h"
#include "host_tool/console/quantities.h"
#include "protocol/base/text.h"
#include "protocol/base/try.h"
#include "protocol/base/version.h"
#include "protocol/command_line/plain_help.h"
#include "protocol/command_line/usage.h"

namespace nodal::host {
namespace {

constexpr std::size_t kLongestReason = 500;  ///< limit of an error message from a rig, in bytes

std::string environment(const char* name, std::string_view otherwise) {
  const char* value = std::getenv(name);
  return value == nullptr || *value == '\0' ? std::string(otherwise) : std::string(value);
}

std::string footer() {
  std::string text =
      "Examples:\n"
      "  nodal stitch a.jpg b.jpg c.jpg -o sphere.jpg     pictures of your own; no rig is needed\n"
      "  nodal look sphere.jpg --open                     shows it in the browser\n"
      "  nodal status --watch                             a rig, here or elsewhere:\n"
      "  nodal --rig ssh://rig.local heads\n"
      "  nodal calibration upload rig.json && nodal genlock start && nodal raymap pull\n"
      "\n"
      "The rig: --rig, else $NODAL_RIG, else " +
      std::string(kDefaultRig) +
      ",\n"
      "else that of a rig that you run yourself by nodald --scan's rig.toml.\n"
      "`nodal COMMAND --help` explains a command; `man nodal` has it all.\n"
      "\nExit codes:\n";
  for (const ExitCodeHelp& help : exit_code_help()) {
    text += fmt::format("  {}  {}\n", static_cast<int>(help.code), help.meaning);
  }
  return text;
}

}  // namespace

Result<std::unique_ptr<RigConnection>> Context::connect() {
  if (connect_by) return connect_by();
  const Result<Duration> patience = parse_duration(timeout);
  if (!patience) return fail(patience.error().in("--timeout"));
  NODAL_TRY_ASSIGN(const RigAddress where, address());
  return RigConnection::open(where, *patience, open_link);
}

Result<RigAddress> Context::address() const {
  const std::string where = rig.empty() ? environment("NODAL_RIG", rig_of_this_machine()) : rig;
  return parse_rig_address(where, environment("NODAL_SSH", "ssh"));
}

Result<wire::Reply> Context::ask(const wire::Request& request) {
  NODAL_TRY_ASSIGN(std::unique_ptr<RigConnection> rig_connection, connect());
  return rig_connection->ask(request);
}

void show_setting(Console& console, Json document, const wire::Reply& reply) {
  const std::string reason = printable(reply.not_stored(), kLongestReason);
  if (!reason.empty()) document["not_stored"] = reason;
  console.document(document);
  if (!reason.empty()) console.note("nodal: in effect, but not stored on the rig: " + reason);
}

CLI::App* add_command(CLI::App& parent, const std::string& name, const std::string& description,
                      const std::string& examples) {
  CLI::App* command = parent.add_subcommand(name, description);
  command->fallthrough();                                             // --rig and --json may also follow the command
  command->footer(examples.empty() ? "" : "Examples:\n" + examples);  // never the parent's, which CLI11 would inherit
  return command;
}

CommandLine::CommandLine(Console& console, Add add_commands)
    : console_(console),
      context_(console),
      app_("Makes spheres of pictures, and runs camera rigs: calibrates, watches, films, copies and renders takes.",
           "nodal") {
  app_.formatter(std::make_shared<PlainHelp>());  // before there are subcommands, because they inherit it
  app_.set_help_flag("-h,--help", "Print this help and exit");
  app_.set_version_flag("-V,--version", "nodal " NODAL_VERSION, "Print the version and exit");
  app_.require_subcommand(1);
  app_.footer(footer());
  app_.add_option("--rig", context_.rig, "Address of the rig: unix:PATH, usb:[SERIAL] or ssh://[USER@]HOST[:PORT]")
      ->type_name("ADDRESS")
      ->check(checked_by([](const std::string& text) { return parse_rig_address(text, "ssh"); }));
  app_.add_option("--timeout", context_.timeout, "Longest time for an answer of the rig (10s when not given)")
      ->type_name("DURATION")
      ->check(checked_by(parse_duration));
  app_.add_flag("-v,--verbose", context_.verbose, "Say what this command may read, write and start");
  set_overwriting(environment("NODAL_OVERWRITE", "") == "1");
  app_.add_flag_callback(
      "--overwrite", [] { set_overwriting(true); }, "Replace files that are there already; otherwise they are refused");
  app_.add_flag("--json", context_.json, "Print JSON for programs, one document per line");
  add_commands(app_, *this);
}

ExitCode CommandLine::run(int argc, const char* const* argv) {
  ExitCode code = ExitCode::kFailed;
  try {
    code = parse_and_dispatch(argc, argv);
  } catch (const std::bad_alloc&) {
    console_.error(Error{Errc::kOverload, "not enough memory for this; `ulimit -v` may limit it"});
    code = exit_code_of(Errc::kOverload);
  } catch (const std::exception& unexpected) {
    console_.error(Error{Errc::kInternal, fmt::format("unexpected: {}", unexpected.what())});
  }
  return with_lost_output(code);
}

ExitCode CommandLine::with_lost_output(ExitCode code) {
  const int lost = console_.end_output();
  const bool failed = !answered(code);  // then the first error's code is kept
  if (lost == 0) return code;
  if (lost == EPIPE) return failed ? code : ExitCode::kReaderGone;
  const std::string why = lost == EBADF ? "it is closed" : std::strerror(lost);
  console_.error(
      Error{lost == ENOSPC ? Errc::kDiskFull : Errc::kIo,
            fmt::format("standard output could not be written ({}); the answer, or the rest of it, is lost", why)});
  return failed ? code : ExitCode::kOutputLost;
}

ExitCode CommandLine::parse_and_dispatch(int argc, const char* const* argv) {
  try {
    app_.parse(command_words(argc, argv));
  } catch (const CLI::Success& success) {  // --help, --version
    std::ostringstream out, err;
    const int code = app_.exit(success, out, err);
    console_.help(out.str());
    return code == 0 ? ExitCode::kOk : ExitCode::kFailed;
  } catch (const CLI::ParseError& wrong) {
    // CLI11 sets context_.json only after it has accepted the whole line.
    console_.set_json(asks_for_json(argc, argv));
    return refuse_usage(explain_usage(app_, wrong));
  }
  console_.set_json(context_.json);
  return dispatch();
}

ExitCode CommandLine::refuse_usage(const std::string& message) {
  console_.note("nodal: " + message);
  console_.note(usage_hint(app_));
  console_.document({{"error", {{"code", 0}, {"name", "usage"}, {"message", message}}}});
  return ExitCode::kUsage;
}

ExitCode CommandLine::dispatch() {
  const CLI::App* chosen = &app_;
  while (!chosen->get_subcommands().empty()) chosen = chosen->get_subcommands().front();
  const auto action = actions_.find(chosen);
  NODAL_ASSERT(action != actions_.end());
  watch_interrupts();
  context_.answer = ExitCode::kOk;
  Status done;
  if (const Status free = check_outputs(*chosen); !free) done = free;
  if (done && before_command) done = before_command(context_, *chosen);
  if (done) done = action->second(context_);
  console_.finish_progress();
  if (done) return context_.answer;
  if (is_about_option(done.error())) return refuse_usage(done.error().message);
  console_.error(done.error());
  if (done.error().code == Errc::kCancelled && interrupted()) return exit_code_of_signal(interrupting_signal());
  return exit_code_of(done.error().code);
}

}  // namespace nodal::host
