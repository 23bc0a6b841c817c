#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "host_tool/commands/command.h"
#include "host_tool/commands/command_list.h"
#include "host_tool/console/quantities.h"
#include "host_tool/rig/wire_json.h"
#include "protocol/base/try.h"

namespace nodal::host {
namespace {

struct ExposureArgs {
  std::string program;
  std::string anchor;
  std::string target;
  std::string difference;
  std::string ramp;
  std::string longest;
  std::string gain;
};

std::string stops(std::int64_t thousandths) {
  return fmt::format("{:+.2f} stops", static_cast<double>(thousandths) / 1000);
}
/// Shutter and gain as the shutter time that gives the same light at 0 dB. Thousandths of log2(microseconds).
std::string at_0_db(std::int64_t thousandths) {
  const double ns = 1000 * std::exp2(std::clamp(static_cast<double>(thousandths) / 1000, -10.0, 40.0));
  return show_duration(static_cast<std::uint64_t>(std::llround(ns)));
}
std::string in_stops(std::uint32_t thousandths) {
  return fmt::format("{} stop{}", thousandths / 1000.0, thousandths == 1000 ? "" : "s");
}
std::string percent(std::uint32_t ppm) { return fmt::format("{:.1f} %", ppm / 1e4); }

void show(Console& console, const wire::ExposureState& state, const wire::Heads& heads) {
  const wire::ExposureRequest& settings = state.settings();
  const auto name = [&](std::uint32_t index) {
    const auto found = std::ranges::find_if(heads.heads(), [&](const auto& head) { return head.index() == index; });
    return found == heads.heads().end() ? std::to_string(index) : found->name();
  };
  const bool automatic = settings.program() != "manual";
  std::string line = "exposure " + settings.program();
  if (settings.locked()) line += ", locked";
  else if (automatic)
    line += state.sets() == 0 ? ", nothing metered yet" : state.settled() ? ", settled" : ", settling";
  line += fmt::format("; target: mean light {} below white; shutter at most {}, gain at most {}",
                      in_stops(settings.target_below()), show_exposure(settings.longest_ns()),
                      show_gain(settings.highest_gain_mdb()));
  if (settings.program() == "joint") {
    line += "; neighbours differ by at most " + in_stops(settings.difference());
    if (settings.anchor() >= 0) line += ", relative to " + name(static_cast<std::uint32_t>(settings.anchor()));
  }
  for (const std::string& part : wrapped(line, kLineWidth)) console.line(part);
  using Align = Table::Align;
  Table table({{"head"},
               {"exposure at 0 dB", Align::kRight},
               {"goal at 0 dB", Align::kRight},
               {"mean light", Align::kRight},
               {"clipped", Align::kRight},
               {"black", Align::kRight}});
  for (const wire::HeadExposure& head : state.heads()) {
    if (!head.metered()) {
      table.row({name(head.index()), "-", "-", "-", "-", "-"});
      continue;
    }
    table.row({name(head.index()), at_0_db(head.exposure()), automatic ? at_0_db(head.goal()) : "-",
               stops(std::int64_t{head.light()} + head.exposure()), percent(head.clipped_ppm()),
               percent(head.black_ppm())});
  }
  for (const std::string& row : table.lines()) console.line(row);
}

Status ask_and_show(Context& context, RigConnection& rig, const wire::Request& request) {
  NODAL_TRY_ASSIGN(const wire::Reply reply, rig.ask(request));
  wire::Request names;
  names.mutable_heads();
  NODAL_TRY_ASSIGN(const wire::Reply heads, rig.ask(names));
  show_setting(context.console(), to_json(reply.exposure()), reply);
  show(context.console(), reply.exposure(), heads.heads());
  return {};
}

Status run_lock(Context& context, bool locked) {
  NODAL_TRY_ASSIGN(std::unique_ptr<RigConnection> rig, context.connect());
  wire::Request request;
  request.mutable_exposure()->set_locked(locked);
  return ask_and_show(context, *rig, request);
}

Status show_exposure_control(Context& context) {
  NODAL_TRY_ASSIGN(std::unique_ptr<RigConnection> rig, context.connect());
  wire::Request request;
  request.mutable_exposure();
  return ask_and_show(context, *rig, request);
}

/// The index of the head with this name; -1 for "none".
Result<std::int32_t> anchor_of(RigConnection& rig, const std::string& name) {
  if (name == "none") return -1;
  wire::Request request;
  request.mutable_heads();
  NODAL_TRY_ASSIGN(const wire::Reply reply, rig.ask(request));
  std::string known;
  for (const wire::HeadState& head : reply.heads().heads()) {
    if (head.name() == name) return static_cast<std::int32_t>(head.index());
    known += (known.empty() ? "" : ", ") + head.name();
  }
  return fail(Errc::kNoSuchDevice, fmt::format("no head is called '{}'; there are {}, or say `none`", name, known));
}

Status set_exposure_control(Context& context, const ExposureArgs& args) {
  NODAL_TRY_ASSIGN(std::unique_ptr<RigConnection> rig, context.connect());
  wire::Request request;
  wire::ExposureRequest& settings = *request.mutable_exposure();
  if (!args.program.empty()) settings.set_program(args.program);
  if (!args.anchor.empty()) {
    NODAL_TRY_ASSIGN(const std::int32_t anchor, anchor_of(*rig, args.anchor));
    settings.set_anchor(anchor);
  }
  if (const auto target = parse_stops(args.target)) settings.set_target_below(*target);
  if (const auto difference = parse_stops(args.difference)) settings.set_difference(*difference);
  if (const auto ramp = parse_stops(args.ramp)) settings.set_ramp(*ramp);
  if (const auto longest = parse_exposure(args.longest)) {
    settings.set_longest_ns(static_cast<std::uint64_t>(longest->duration().ns()));
  }
  if (const auto gain = parse_gain(args.gain)) settings.set_highest_gain_mdb(gain->mdb());
  return ask_and_show(context, *rig, request);
}

}  // namespace

void add_exposure(CLI::App& app, CommandLine& line) {
  CLI::App* exposure = add_command(
      app, "exposure", "Who sets shutters and gains: hosts, every head by itself, or all heads together", "");
  exposure->require_subcommand(1);

  CLI::App* show_it = add_command(*exposure, "show", "Show the program, each head's light, and its target",
                                  "  nodal exposure show --json | jq .settled\n");
  line.on(show_it, show_exposure_control);

  auto args = std::make_shared<ExposureArgs>();
  CLI::App* set = add_command(*exposure, "set", "Choose the program and its settings",
                              "  nodal exposure set joint\n"
                              "  nodal exposure set joint --difference 2 --anchor cam0\n"
                              "  nodal exposure set --target 3 --longest 1/100\n"
                              "  nodal exposure set manual\n");
  set->add_option("PROGRAM", args->program, "manual, each or joint")
      ->type_name("manual|each|joint")
      ->check(CLI::IsMember({"manual", "each", "joint"}));
  set->add_option("--anchor", args->anchor, "joint: a head that is exposed for what it sees; none")->type_name("HEAD");
  const auto stops_option = [&](const char* name, std::string& into, const char* help) {
    set->add_option(name, into, help)->type_name("STOPS")->check(checked_by(parse_stops));
  };
  stops_option("--target", args->target, "Mean light, in stops below white: 2.5");
  stops_option("--difference", args->difference, "joint: between heads that overlap, at most: 1; 0 is all alike");
  stops_option("--ramp", args->ramp, "From one set to the next, at most: 4; 0.02 cannot be seen in a film");
  set->add_option("--longest", args->longest, "Longest shutter time: 16ms, 1/60")
      ->type_name("TIME")
      ->check(checked_by(parse_exposure));
  set->add_option("--highest-gain", args->gain, "Highest gain: 12dB")->type_name("GAIN")->check(checked_by(parse_gain));
  set->parse_complete_callback([args, set] {
    if (set->count_all() <= 1) throw CLI::RequiredError("a program, or at least one option");
  });
  line.on(set, [args](Context& context) { return set_exposure_control(context, *args); });

  CLI::App* lock = add_command(*exposure, "lock", "Keep the present exposures", "  nodal exposure lock\n");
  line.on(lock, [](Context& context) { return run_lock(context, true); });
  CLI::App* unlock = add_command(*exposure, "unlock", "Continue the program", "  nodal exposure unlock\n");
  line.on(unlock, [](Context& context) { return run_lock(context, false); });
}

}  // namespace nodal::host
