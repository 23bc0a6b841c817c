#include <fmt/format.h>

#include "host_tool/commands/command.h"
#include "host_tool/commands/command_list.h"
#include "host_tool/console/interrupt.h"
#include "host_tool/console/quantities.h"
#include "host_tool/rig/wire_json.h"
#include "protocol/base/try.h"

namespace nodal::host {
namespace {

struct StatusArgs {
  bool watch = false;
  std::string interval = "1s";
  std::uint64_t count = 0;
};

std::uint64_t lost_frames(const wire::RigStatus& status) {
  std::uint64_t lost = 0;
  for (const wire::Count& loss : status.losses()) lost += loss.frames();
  return lost;
}

std::string list_of(const google::protobuf::RepeatedPtrField<wire::Count>& counts) {
  std::string text;
  for (const wire::Count& count : counts) {
    if (count.frames() != 0) text += fmt::format("{}{} {}", text.empty() ? "" : ", ", count.reason(), count.frames());
  }
  return text.empty() ? "none" : text;
}

Colour colour_of(const std::string& state) {
  if (state == "running" || state == "locked") return Colour::kGood;
  if (state == "degraded" || state == "lost") return Colour::kBad;
  return Colour::kWarning;
}

/// The state's name in the protocol, as a person reads it.
std::string state_text(const std::string& state) { return state == "no-calibration" ? "no calibration" : state; }

std::string recording_text(const wire::Recording& takes) {
  const std::string durable =
      takes.has_durable_ns() ? "all but the last " + show_duration(takes.durable_ns()) : "nothing yet";
  return fmt::format("{} is being recorded: {}, {}; safe on the disk: {}; buffer {} % full, {} free{}", takes.take(),
                     show_duration(takes.length_ns()), counted(takes.sets(), "set"), durable, takes.buffer_percent(),
                     show_bytes(takes.free_bytes()), takes.loop() ? ", then the oldest is deleted" : "");
}

void show(Console& console, const wire::RigStatus& status, const std::string& name, const std::string& address) {
  const auto row = [&](std::string_view what, const std::string& value) {
    constexpr std::size_t kIndent = 15;
    for (const std::string& part : wrapped(value, kLineWidth - kIndent)) {
      console.line(fmt::format("  {:<12} {}", what, part));
      what = "";
    }
  };
  const wire::Genlock& genlock = status.genlock();
  console.line(fmt::format("{} at {}: {}", console.paint(Colour::kStrong, name), address,
                           console.paint(colour_of(status.state()), state_text(status.state()))));
  if (!status.problem().empty()) row("problem", console.paint(Colour::kWarning, status.problem()));
  if (!status.activity().empty()) row("now", status.activity());
  row("up", show_duration(status.uptime_ns()));
  row("calibration", status.calibration_id().empty()
                         ? "none; `nodal calibration upload FILE` uploads one"
                         : fmt::format("{} ({})", status.calibration_name(), show_id(status.calibration_id())));
  if (status.has_trial()) {
    row("trial", fmt::format("the rig goes back to {} in {} unless a host keeps the trial",
                             show_id(status.trial().before()), show_duration(status.trial().left_ns())));
  }
  const std::string by =
      genlock.aligned() ? "heads run free and are moved" : fmt::format("{} triggers", genlock.triggers());
  row("genlock", fmt::format("{} at {}/{} Hz, {}, spread {} (worst {})",
                             console.paint(colour_of(genlock.state()), genlock.state()), genlock.rate_numerator(),
                             genlock.rate_denominator(), by, show_duration(genlock.spread_ns()),
                             show_duration(genlock.spread_worst_ns())));
  for (const std::string& why : genlock.unaligned()) row("", console.paint(Colour::kWarning, why));
  if (genlock.missing_triggers() != 0) {
    row("", console.paint(Colour::kBad, counted(genlock.missing_triggers(), "trigger pulse") + " not sent"));
  }
  row("raymaps",
      fmt::format("{} of {} a second{}, {}×{}; blend {}, encode {}", show_rate(status.rate_millihertz()),
                  show_rate(status.rate_wanted_millihertz()), status.raymaps_a_set() == 2 ? ", one a field" : "",
                  status.raymap_width(), status.raymap_height(), show_duration(status.blend_ns()),
                  show_duration(status.encode_ns())));
  const std::uint64_t lost = lost_frames(status);
  const std::uint64_t sum = status.frames_in_sets() + lost + status.frames_held();
  if (status.has_seams()) {
    const wire::Seams& seams = status.seams();
    row("seams",
        fmt::format("placed anew {}; late {}", counted(seams.placed(), "time"), counted(seams.late(), "time")));
    if (seams.refused() != 0) {
      row("", console.paint(Colour::kBad,
                            fmt::format("{} refused, because the table failed its proof; this is a bug of nodald",
                                        seams.refused())));
    }
  }
  row("frames", fmt::format("{} from the heads: {} in sets, {} lost, {} waiting for their set", status.frames_taken(),
                            status.frames_in_sets(), lost, status.frames_held()));
  if (sum != status.frames_taken()) {
    row("", console.paint(Colour::kBad, fmt::format("frames are not conserved: {} against {}; this is a bug of nodald",
                                                    status.frames_taken(), sum)));
  }
  row("losses", list_of(status.losses()));
  row("sets", fmt::format("{} ({} with every head); lost: {}", status.sets(), status.full_sets(),
                          list_of(status.set_losses())));
  if (status.encode_failures() != 0) {
    row("encoding",
        console.paint(Colour::kBad, fmt::format("{} raymaps could not be encoded", status.encode_failures())));
  }
  row("published", fmt::format("{} of {} raymaps; not sent to clients that were too slow: {}", status.published(),
                               status.raymaps(), list_of(status.publish_drops())));
  if (status.publish_shed() != 0) {
    row("", fmt::format("{} not published: the board had no time for it", status.publish_shed()));
  }
  if (status.has_recording()) {
    const wire::Recording& takes = status.recording();
    row("take", takes.has_take()  ? recording_text(takes)
                : takes.ejected() ? "none is being recorded: the disk was ejected; mount it, or another one, or use it "
                                    "again with `nodal take start`"
                                  : "none is being recorded");
    const std::uint64_t slow = takes.lost_sets() - std::min(takes.lost_sets(), takes.lost_by_errors());
    if (slow + takes.lost_raymaps() != 0) {
      row("", console.paint(Colour::kBad, fmt::format("{} and {} lost: the disk is too slow", counted(slow, "set"),
                                                      counted(takes.lost_raymaps(), "raymap"))));
    }
    if (takes.lost_by_errors() != 0) {
      row("", console.paint(Colour::kBad, counted(takes.lost_by_errors(), "set") + " lost by an error of the disk"));
    }
    if (!takes.problem().empty()) row("", console.paint(Colour::kWarning, takes.problem()));
  }
  row("memory", show_bytes(status.resident_bytes()));
  if (status.marks().empty()) return;
  const wire::Mark& newest = status.marks(status.marks_size() - 1);
  row("marks", fmt::format("{} by the button, the newest at set {}, {} ago", status.marks_size(), newest.set(),
                           show_duration(status.uptime_ns() - newest.at_ns())));
}

/// One line for --watch, used if standard output is not a terminal.
std::string one_line(const wire::RigStatus& status) {
  return fmt::format("{}  raymaps {} at {}/s  genlock {} spread {}  frames {} in sets {}  losses: {}", status.state(),
                     status.raymaps(), show_rate(status.rate_millihertz()), status.genlock().state(),
                     show_duration(status.genlock().spread_ns()), status.frames_taken(), status.frames_in_sets(),
                     list_of(status.losses()));
}

Status run_status(Context& context, const StatusArgs& args) {
  const Result<Duration> interval = parse_duration(args.interval);
  if (!interval) return fail(interval.error().in("--interval"));
  NODAL_TRY_ASSIGN(std::unique_ptr<RigConnection> rig, context.connect());
  Console& console = context.console();
  wire::Request request;
  request.mutable_status();
  const bool endless = args.watch && args.count == 0;  // then Ctrl-C is its normal end
  for (std::uint64_t shown = 0;;) {
    const Result<wire::Reply> reply = rig->ask(request);
    if (!reply) {
      if (endless && interrupted()) return {};
      return fail(reply.error());
    }
    const wire::RigStatus& status = reply->status();
    console.document(to_json(status, rig->rig().rig_name(), rig->address()));
    if (args.watch && !console.out_is_terminal()) {
      console.line(one_line(status));
    } else {
      if (args.watch) console.home();
      show(console, status, rig->rig().rig_name(), rig->address());
      if (args.watch) console.foot("Ctrl-C ends");
    }
    ++shown;
    if (!args.watch || shown == args.count || console.output_gone()) return {};
    // No stream is open: this only waits, and detects at once if the link closes.
    const Status waited = rig->rest(*interval);
    if (endless && interrupted()) return {};
    if (!waited) return fail(waited.error());
  }
}

}  // namespace

void add_status(CLI::App& app, CommandLine& line) {
  CLI::App* command = add_command(app, "status", "Show the rig's state: rate, sync, losses, memory",
                                  "  nodal status\n"
                                  "  nodal status --watch                    redrawn every second, Ctrl-C ends\n"
                                  "  nodal status --watch --interval 10s >> rig.log\n"
                                  "  nodal status --json | jq .losses\n");
  auto args = std::make_shared<StatusArgs>();
  command->add_flag("-w,--watch", args->watch, "Repeat; redrawn on a terminal, else one line each time");
  command->add_option("--interval", args->interval, "With --watch: how often (1s when not given)")
      ->type_name("DURATION")
      ->check(checked_by(parse_duration));
  command->add_option("--count", args->count, "With --watch: end after this many")->type_name("N");
  line.on(command, [args](Context& context) { return run_status(context, *args); });
}

}  // namespace nodal::host
