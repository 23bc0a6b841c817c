// `nodal disk`: what the disk of the rig's takes sustains, and its end.
#include <fmt/format.h>

#include <memory>
#include <string>

#include "host_tool/commands/command.h"
#include "host_tool/commands/command_list.h"
#include "host_tool/console/quantities.h"
#include "protocol/base/try.h"

namespace nodal::host {
namespace {

Status run_disk_test(Context& context, const std::string& length) {
  NODAL_TRY_ASSIGN(std::unique_ptr<RigConnection> rig, context.connect());
  wire::Request request;
  request.mutable_disk_test()->set_length_ns(static_cast<std::uint64_t>(parse_duration(length)->ns()));
  NODAL_TRY_ASSIGN(wire::Reply reply, [&] {
    Progress bar(context.console(), "testing the disk", 100);
    return rig->ask_long(request, [&](const wire::RigStatus& status) {
      if (status.recording().has_disk_test_percent()) bar.update(status.recording().disk_test_percent(), "");
    });
  }());
  const wire::DiskTested& tested = reply.disk_test();
  Console& console = context.console();
  Json modes = Json::array();
  console.line(fmt::format("{} written in {}: {}/s; the longest sync took {}", show_bytes(tested.bytes()),
                           show_duration(tested.took_ns()), show_bytes(tested.bytes_a_second()),
                           show_duration(tested.worst_sync_ns())));
  bool any = false;
  for (const wire::DiskMode& mode : tested.modes()) {
    any |= mode.sustained();
    modes.push_back({{"mode", mode.mode()},
                     {"bytes_a_second", mode.bytes_a_second()},
                     {"sustained", mode.sustained()},
                     {"why", mode.why()}});
    console.line(fmt::format("mode = \"{}\": {}: {}", mode.mode(),
                             mode.sustained() ? "sustained" : console.paint(Colour::kBad, "not sustained"),
                             mode.why()));
  }
  console.document({{"bytes", tested.bytes()},
                    {"took_ns", tested.took_ns()},
                    {"worst_sync_ns", tested.worst_sync_ns()},
                    {"bytes_a_second", tested.bytes_a_second()},
                    {"modes", modes}});
  if (!any) context.answer = ExitCode::kJudged;
  return {};
}

Status run_disk_eject(Context& context) {
  wire::Request request;
  request.mutable_disk_eject();
  NODAL_TRY_ASSIGN(const wire::Reply reply, context.ask(request));
  const std::uint64_t take = reply.take().take();
  context.console().document({{"take", take == 0 ? Json() : Json(take)}, {"ejected", true}});
  const std::string ended = take == 0 ? "" : fmt::format("take {} is finished; ", take);
  context.console().line(
      ended + "everything is on the disk, and the rig has nothing open there: unmount it, and it can be removed");
  return {};
}

}  // namespace

void add_disk(CLI::App& app, CommandLine& line) {
  CLI::App* disk = add_command(app, "disk", "The disk of the rig's takes", "");
  disk->require_subcommand(1);
  auto length = std::make_shared<std::string>("10s");
  CLI::App* test =
      add_command(*disk, "test", "Measure which modes of [takes] the disk sustains, before a take is recorded",
                  "  nodal disk test\n"
                  "  nodal disk test --for 30s --json\n"
                  "It writes to the takes' folder for a while, and removes what it wrote. Exits with 8 if no\n"
                  "mode is sustained.\n");
  CLI::App* eject =
      add_command(*disk, "eject", "End the take, write everything to the disk, and let go of it",
                  "  nodal disk eject\n"
                  "When it returns, the disk can be unmounted and removed. The rig uses the disk that is\n"
                  "mounted there next; with start = \"boot\" it goes on recording on that one. `nodal take\n"
                  "start` uses the ejected one again.\n");
  line.on(eject, run_disk_eject);
  test->add_option("--for", *length, "How long, 1s to 60s")
      ->type_name("DURATION")
      ->capture_default_str()
      ->check(checked_by(parse_duration));
  line.on(test, [length](Context& context) { return run_disk_test(context, *length); });
}

}  // namespace nodal::host
