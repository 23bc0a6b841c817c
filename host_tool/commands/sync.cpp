#include <fmt/format.h>

#include "host_tool/commands/command.h"
#include "host_tool/commands/command_list.h"
#include "host_tool/console/files.h"
#include "host_tool/console/interrupt.h"
#include "host_tool/console/quantities.h"
#include "host_tool/report/sync_report.h"
#include "host_tool/rig/frame_period.h"
#include "host_tool/rig/rig_input.h"
#include "host_tool/rig/stream_wait.h"
#include "protocol/base/try.h"

namespace nodal::host {
namespace {

struct SyncArgs {
  std::uint64_t sets = 300;
  std::string svg;
};

Result<std::vector<std::string>> head_names(RigConnection& rig) {
  wire::Request request;
  request.mutable_heads();
  NODAL_TRY_ASSIGN(const wire::Reply reply, rig.ask(request));
  std::vector<std::string> names;
  for (const wire::HeadState& head : reply.heads().heads()) names.push_back(head.name());
  return names;
}

/// Collects the timing data of sets until there are enough, Ctrl-C, or the rig closes the stream.
Status collect(RigConnection& rig, StreamId stream, const SyncArgs& args, Console& console, SyncReport& report) {
  NODAL_TRY_ASSIGN(const Duration within, patience_for_sets(rig));
  Progress progress(console, "set", args.sets);
  StreamWait wait(rig, stream, within, "the sets' timing; `nodal status` says whether there are sets");
  while (report.sets() < args.sets) {
    const Result<Event> event = wait.next();
    if (interrupted()) break;
    if (!event) return fail(event.error());
    if (const auto* closed = std::get_if<StreamClosed>(&*event)) {
      if (closed->error) return fail(*closed->error);
      break;
    }
    const auto* piece = std::get_if<BulkPiece>(&*event);
    if (piece == nullptr || !piece->first) continue;
    NODAL_TRY_ASSIGN(const auto header, parse_clean<wire::RaymapHeader>(piece->meta, "timing data of a set"));
    report.add(header);
    wait.restart();
    report.set_dropped(piece->dropped);
    progress.update(report.sets(), header.genlock());
  }
  rig.stop_stream(stream);
  return {};
}

Status run_sync(Context& context, const SyncArgs& args) {
  Console& console = context.console();
  NODAL_TRY_ASSIGN(std::unique_ptr<RigConnection> rig, context.connect());
  NODAL_TRY_ASSIGN(std::vector<std::string> names, head_names(*rig));
  wire::Request request;
  request.mutable_pull()->set_coding(wire::PullRequest::EVIDENCE);
  NODAL_TRY_ASSIGN(const wire::Reply started, rig->ask(request));
  SyncReport report(std::move(names));
  const Status collected = collect(*rig, StreamId{started.pull().stream()}, args, console, report);
  console.finish_progress();
  if (!collected) return fail(collected.error());
  if (report.sets() == 0 && interrupted()) return fail(Errc::kCancelled, "stopped by a signal before the first set");
  if (report.sets() == 0) return fail(Errc::kNotReady, "no set came; `nodal status` says what the rig is doing");
  console.document(report.json());
  for (const std::string& line : report.lines()) console.line(line);
  if (!args.svg.empty()) {
    NODAL_TRY(write_file(args.svg, report.svg()));
    console.note("drawn in " + args.svg);
  }
  if (interrupted() && report.sets() < args.sets) {
    return fail(Errc::kCancelled, fmt::format("stopped by a signal after {} of {} sets", report.sets(), args.sets));
  }
  return {};
}

}  // namespace

void add_sync(CLI::App& app, CommandLine& line) {
  CLI::App* sync = add_command(app, "sync", "Measure how well the heads are exposed together", "");
  sync->require_subcommand(1);
  CLI::App* report = add_command(*sync, "report", "Skew of every head, drift and losses over many sets",
                                 "  nodal sync report                          ten seconds at 29.97\n"
                                 "  nodal sync report -n 1800 --svg sync.svg\n"
                                 "  nodal sync report --json | jq '.heads[] | {name, worst_ns}'\n");
  auto args = std::make_shared<SyncArgs>();
  report->add_option("-n,--sets", args->sets, "How many sets (300 when not given)")
      ->type_name("N")
      ->check(CLI::Range(std::uint64_t{1}, std::uint64_t{1'000'000}));
  report->add_option("--svg", args->svg, "Draw every head's skew in this file")->type_name("FILE");
  line.on(report, [args](Context& context) { return run_sync(context, *args); });
}

}  // namespace nodal::host
