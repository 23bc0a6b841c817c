#include "stitch/registration/drift.h"
#include "protocol/base/try.h"

#include <fmt/format.h>

#include <cmath>

#include "host_tool/commands/command.h"
#include "host_tool/commands/command_list.h"
#include "host_tool/commands/picture_places_option.h"
#include "host_tool/console/files.h"
#include "host_tool/console/interrupt.h"
#include "host_tool/input/live_frames.h"
#include "host_tool/input/registration_advice.h"

namespace nodal::host {
namespace {

using registration::DriftReport;
using registration::HeadDrift;
using registration::Standing;

struct DriftArgs {
  std::vector<std::string> inputs;
  int sets = kLiveSets;
  registration::DriftOptions options;
  std::string out;
  PicturePlaces places = PicturePlaces::kBesideProject;
};

/// All pictures are decoded.
Result<RigPictures> read_input(Context& context, const DriftArgs& args) {
  if (args.inputs.empty()) {
    NODAL_TRY_ASSIGN(std::unique_ptr<RigConnection> rig, context.connect());
    return pull_frame_sets(*rig, "nodal drift", args.sets, context.console());
  }
  return interruptible(context.console(), [&] { return read_all_pictures({}, args.inputs, {args.places}); });
}

/// The word of the JSON document.
std::string verdict_word(const DriftReport& report) {
  if (report.any(Standing::kMoved)) return "moved";
  return report.any(Standing::kUnknown) ? "cannot-tell" : "stands";
}

Json finite_json(double value) { return std::isfinite(value) ? Json(value) : Json(nullptr); }

Json drift_json(const DriftReport& report, double tolerance_px) {
  Json heads = Json::array();
  for (const HeadDrift& head : report.heads) {
    heads.push_back({{"name", head.name},
                     {"standing", standing_name(head.standing)},
                     {"why", head.why},
                     {"moved_deg", head.moved_deg},
                     {"sigma_deg", finite_json(head.sigma_deg)},
                     {"moved_px", head.moved_px},
                     {"sigma_px", finite_json(head.sigma_px)},
                     {"up_deg", head.up_deg},
                     {"right_deg", head.right_deg},
                     {"roll_deg", head.roll_deg}});
  }
  return {{"verdict", verdict_word(report)},
          {"moved", report.any(Standing::kMoved)},
          {"tolerance_px", tolerance_px},
          {"heads", heads},
          {"objective_before", report.objective_before},
          {"objective_after", report.objective_after},
          {"warnings", report.warnings}};
}

std::string verdict_on(const HeadDrift& head) {
  switch (head.standing) {
    case Standing::kStands: return "stands as calibrated";
    case Standing::kMoved: return "has moved";
    case Standing::kUnknown: return "unknown: " + head.why;
  }
  return "";
}

void tell(Console& console, const DriftReport& report) {
  using Align = Table::Align;
  Table table({{"head"}, {"moved", Align::kRight}, {"", Align::kRight}, {"±", Align::kRight}, {""}});
  for (const HeadDrift& head : report.heads) {
    const bool known = std::isfinite(head.sigma_deg);
    table.row({head.name, fmt::format("{:.3f}°", head.moved_deg), fmt::format("{:.2f} px", head.moved_px),
               known ? fmt::format("{:.2g}°", head.sigma_deg) : std::string("?"), verdict_on(head)});
  }
  for (const std::string& line : table.lines()) console.line(line);
  console.line(fmt::format(
      "where they overlap, the heads differ by {:.2f} levels of 255; with the directions found now, by {:.2f}",
      std::sqrt(report.objective_before), std::sqrt(report.objective_after)));
}

/// A sentence that names the heads for which the pictures do not determine it; empty if there are none.
std::string uncertainty(const DriftReport& report) {
  std::string unknown;
  std::size_t count = 0;
  for (const HeadDrift& head : report.heads) {
    if (head.standing != Standing::kUnknown) continue;
    unknown += fmt::format("{}'{}'", count++ == 0 ? "" : ", ", head.name);
  }
  if (count == 0) return "";
  const std::string who = count == report.heads.size() && count > 2 ? std::string("the heads") : unknown;
  return fmt::format(
      "cannot tell whether {} {} as calibrated; take more frame sets (--sets), or a scene with detail "
      "all around",
      who, count == 1 ? "stands" : "stand");
}

/// A sentence that names the heads that moved; empty if none moved.
std::string verdict(const DriftReport& report, bool live) {
  std::string moved;
  for (const HeadDrift& head : report.heads) {
    if (head.standing != Standing::kMoved) continue;
    moved += fmt::format("{}'{}' by {:.3f}° ({:.1f} px)", moved.empty() ? "" : ", ", head.name, head.moved_deg,
                         head.moved_px);
  }
  if (moved.empty()) return "";
  return "the rig is no longer as calibrated; moved: " + moved +
         (live ? "; `nodal register --trial` registers the running rig again"
               : "; `nodal register` registers it again");
}

Result<DriftReport> measured(Console& console, const RigPictures& rig, registration::DriftOptions options) {
  Progress bar(console, "comparing", 1000);
  options.progress = [&](const registration::Step& step, double done) {
    bar.update(static_cast<std::uint64_t>(1000 * done), fmt::format("at a width of {} px", step.width));
  };
  return interruptible(console, [&] { return registration::measure_drift(rig.calibration, rig.frames(), options); });
}

Status run_drift(Context& context, const DriftArgs& args) {
  NODAL_TRY_ASSIGN(const RigPictures input, read_input(context, args));
  for (const std::string& note : input.notes) context.console().note("note: " + note);
  const Result<DriftReport> report = measured(context.console(), input, args.options);
  if (!report) return fail(with_advice(report.error(), false));
  if (!args.out.empty()) {
    NODAL_TRY(write_file(args.out, nodal::to_json(report->calibration)));
  }
  context.console().document(drift_json(*report, args.options.tolerance_px));
  tell(context.console(), *report);
  for (const std::string& warning : report->warnings) context.console().warning(warning);
  if (!args.out.empty()) context.console().line("wrote the calibration with the current rotations to " + args.out);
  if (const std::string moved = verdict(*report, input.origin == RigPictures::Origin::kRig); !moved.empty()) {
    context.console().warning(moved);
    context.answer = ExitCode::kJudged;
  } else if (const std::string unknown = uncertainty(*report); !unknown.empty()) {
    context.console().warning(unknown);
    context.answer = ExitCode::kCannotTell;
  }
  return {};
}

}  // namespace

void add_drift(CLI::App& app, CommandLine& line) {
  CLI::App* command = add_command(
      app, "drift", "Check whether the heads still stand as calibrated, from their current pictures",
      "  nodal drift                            the running rig against its calibration in force\n"
      "  nodal drift --json | jq -r '.heads[] | select(.standing == \"moved\") | .name'\n"
      "  nodal drift rig.json cam*.png          the same from files; needs no rig\n"
      "  if nodal drift; [ $? = 8 ]; then nodal register --trial; fi      registers again only if a head has moved\n"
      "Exit code 0: all heads stand as calibrated; 8: a head has moved; 10: the pictures do not show whether one has.\n"
      "A head has moved if it no longer fits to most of the others; if there are only two, each gets half of the "
      "movement.\n");
  auto args = std::make_shared<DriftArgs>();
  command->add_option("INPUT", args->inputs, "A calibration and pictures taken since, instead of the running rig")
      ->type_name("");
  command->add_option("--sets", args->sets, "Frame sets to take from the rig (3 when not given); more see more detail")
      ->type_name("N")
      ->check(CLI::Range(1, kMaxLiveSets));
  command
      ->add_option("--tolerance", args->options.tolerance_px,
                   "A head has moved if it is off by more than this, px (0.5 when not given)")
      ->type_name("PX")
      ->check(CLI::Range(0.001, 1000.0));
  command->add_option("-o,--out", args->out, "Save the calibration with the heads' current rotations")
      ->type_name("FILE");
  command
      ->add_option("--threads", args->options.threads,
                   "Number of threads (one for each core when not given); the result is the same")
      ->type_name("N")
      ->check(CLI::Range(1, 256));
  add_picture_places(*command, args->places);
  line.on(command, [args](Context& context) { return run_drift(context, *args); });
}

}  // namespace nodal::host
