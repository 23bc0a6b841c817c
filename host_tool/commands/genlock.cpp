#include <fmt/format.h>

#include "host_tool/commands/command.h"
#include "host_tool/commands/command_list.h"
#include "host_tool/console/quantities.h"
#include "host_tool/rig/wire_json.h"
#include "protocol/base/try.h"

namespace nodal::host {
namespace {

struct GenlockArgs {
  std::string rate;
  std::string pulse;
};

Status run_genlock(Context& context, wire::GenlockRequest::Action action, const GenlockArgs& args) {
  wire::Request request;
  wire::GenlockRequest& genlock = *request.mutable_genlock();
  genlock.set_action(action);
  if (!args.rate.empty()) {
    NODAL_TRY_ASSIGN(const FrameRate rate, parse_rate(args.rate));
    genlock.set_rate_numerator(rate.numerator);
    genlock.set_rate_denominator(rate.denominator);
  }
  if (!args.pulse.empty()) {
    const Result<Duration> pulse = parse_duration(args.pulse);
    if (!pulse) return fail(pulse.error().in("--pulse"));
    genlock.set_pulse_width_ns(static_cast<std::uint64_t>(pulse->ns()));
  }
  NODAL_TRY_ASSIGN(const wire::Reply reply, context.ask(request));
  const wire::Genlock& now = reply.genlock();
  show_setting(context.console(), to_json(now), reply);
  const std::string by = now.aligned() ? "heads run free and are moved" : counted(now.triggers(), "trigger");
  context.console().line(
      fmt::format("genlock {} at {}/{} Hz; {}", now.state(), now.rate_numerator(), now.rate_denominator(), by));
  context.console().line(fmt::format("spread of mid-exposures {} (worst {})", show_duration(now.spread_ns()),
                                     show_duration(now.spread_worst_ns())));
  for (const std::string& why : now.unaligned()) {
    context.console().line(context.console().paint(Colour::kWarning, why));
  }
  std::string losses;
  for (const wire::PulseCount& count : now.pulse_losses()) {
    losses += (losses.empty() ? "" : ", ") + fmt::format("{} {}", count.pulses(), count.reason());
  }
  if (!losses.empty()) {
    context.console().line(context.console().paint(Colour::kWarning, "pulses since nodald started: " + losses));
  }
  std::string drift = "not known yet";
  if (now.has_drift_ppb()) drift = fmt::format("{:+.2f} ppm", now.drift_ppb() / 1000.0);
  context.console().line(fmt::format("lost {}, in holdover {}; {} missing; drift {}", counted(now.losses(), "time"),
                                     counted(now.holdovers(), "time"), counted(now.missing_triggers(), "trigger"),
                                     drift));
  return {};
}

}  // namespace

void add_genlock(CLI::App& app, CommandLine& line) {
  CLI::App* genlock = add_command(app, "genlock", "Expose all heads together: start, stop, accuracy", "");
  genlock->require_subcommand(1);
  auto args = std::make_shared<GenlockArgs>();

  CLI::App* start = add_command(
      *genlock, "start",
      "Expose the heads together from now on: by a trigger, or by moving heads\nthat run free, as rig.toml says",
      "  nodal genlock start                     at the rig's own rate\n"
      "  nodal genlock start --rate 30000/1001\n");
  start->add_option("--rate", args->rate, "Frames a second: 30000/1001, 29.97, 25")
      ->type_name("RATE")
      ->check(checked_by(parse_rate));
  start->add_option("--pulse", args->pulse, "Width of the trigger pulse, such as 100us")
      ->type_name("DURATION")
      ->check(checked_by(parse_duration));
  line.on(start, [args](Context& context) { return run_genlock(context, wire::GenlockRequest::START, *args); });

  CLI::App* stop = add_command(*genlock, "stop", "Let every head run by its own clock again", "  nodal genlock stop\n");
  line.on(stop, [](Context& context) { return run_genlock(context, wire::GenlockRequest::STOP, {}); });

  CLI::App* show = add_command(*genlock, "show", "State, rate, triggers and spread",
                               "  nodal genlock show --json | jq .spread_ns\n");
  line.on(show, [](Context& context) { return run_genlock(context, wire::GenlockRequest::SHOW, {}); });
}

}  // namespace nodal::host
