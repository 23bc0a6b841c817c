#include <fmt/format.h>

#include <algorithm>
#include <climits>
#include <memory>

#include "host_tool/commands/command.h"
#include "host_tool/commands/command_list.h"
#include "host_tool/console/quantities.h"
#include "host_tool/input/control_latency.h"
#include "host_tool/input/live_frames.h"
#include "protocol/base/try.h"

namespace nodal::host {
namespace {

/// "2", "2 to 3"; frames, 0 is the first that begins after the request.
std::string text_of(const LatencyBounds& bounds) {
  if (bounds.exact()) return std::to_string(bounds.low());
  return fmt::format("{} to {}", std::min(bounds.low(), bounds.high()), std::max(bounds.low(), bounds.high()));
}

Json latency_json(const LatencyBounds& bounds) {
  return {{"low", std::min(bounds.low(), bounds.high())}, {"high", std::max(bounds.low(), bounds.high())}};
}

Status run_latency(Context& context, const std::string& name) {
  Console& console = context.console();
  NODAL_TRY_ASSIGN(std::unique_ptr<RigConnection> rig, context.connect());
  NODAL_TRY(require_feature(*rig, "frame-sets", "`nodal heads latency`"));
  // A rig without it would keep an exposure that is set for the measurement only.
  NODAL_TRY(require_feature(*rig, "temporary-settings", "`nodal heads latency`"));
  wire::Request request;
  request.mutable_heads();
  NODAL_TRY_ASSIGN(const wire::Reply reply, rig->ask(request));
  NODAL_TRY_ASSIGN(const std::uint32_t index, find_head(reply.heads(), name));
  const auto head = std::ranges::find(reply.heads().heads(), index, &wire::HeadState::index);

  const Result<ControlLatency> measured = measure_control_latency(
      *rig, *head, [&](int step) { console.progress(fmt::format("step {} of at most {}", step, kLatencySteps)); });
  console.finish_progress();
  if (!measured) return fail(measured.error());
  const bool agrees =
      measured->seen.exact() && measured->stated.exact() && measured->seen.low() == measured->stated.low();
  console.document({{"head", head->name()},
                    {"seen_frames", latency_json(measured->seen)},
                    {"stated_frames", latency_json(measured->stated)},
                    {"agrees", agrees},
                    {"exposure_ns", measured->exposure_ns},
                    {"stepped_ns", measured->stepped_ns},
                    {"brightness", measured->brightness},
                    {"stepped_brightness", measured->stepped_brightness},
                    {"steps", measured->steps}});
  console.line(
      fmt::format("{}: the picture changes with frame {} after the request, and the rig states it for frame {}",
                  head->name(), text_of(measured->seen), text_of(measured->stated)));
  if (agrees) return {};
  const bool contradict = measured->seen.exact() && measured->stated.exact();
  console.line(console.paint(
      Colour::kBad, contradict
                        ? "the exposures that the rig states for frames in between are wrong"
                        : "this does not show whether the exposures that the rig states are right; measure again"));
  context.answer = contradict ? ExitCode::kJudged : ExitCode::kCannotTell;
  return {};
}

}  // namespace

void add_latency(CLI::App& heads, CommandLine& line) {
  CLI::App* latency = add_command(heads, "latency", "Measure how many frames pass until a head's exposure takes effect",
                                  "  nodal heads latency cam3\n");
  auto name = std::make_shared<std::string>();
  latency->add_option("HEAD", *name, "Name or index of the head")->required()->type_name("");
  line.on(latency, [name](Context& context) { return run_latency(context, *name); });
}

}  // namespace nodal::host
