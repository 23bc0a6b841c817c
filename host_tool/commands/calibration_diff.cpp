#include <fmt/format.h>

#include "host_tool/commands/command.h"
#include "host_tool/commands/command_list.h"
#include "host_tool/input/calibration_file.h"
#include "protocol/base/try.h"
#include "protocol/calibration.h"
#include "stitch/calibration/difference.h"

namespace nodal::host {
namespace {

struct CalibrationDiffArgs {
  std::string a, b;
};

Status run_calibration_diff(Context& context, const CalibrationDiffArgs& args) {
  NODAL_TRY_ASSIGN(const Calibration a, read_calibration(args.a, context.console()));
  NODAL_TRY_ASSIGN(const Calibration b, read_calibration(args.b, context.console()));
  NODAL_TRY_ASSIGN(const calibration::RigDifference difference, calibration::difference_of(a, b));
  Json heads = Json::array();
  const auto right = Table::Align::kRight;
  Table table({{"head"},
               {"turned°", right},
               {"raw°", right},
               {"px rms", right},
               {"px max", right},
               {"lens px", right},
               {"lens max", right},
               {"gain stops r g b", right},
               {"fall-off stops", right},
               {"response /255", right}});
  for (const calibration::HeadDifference& d : difference.heads) {
    heads.push_back({{"name", d.name},
                     {"other", d.other},
                     {"turned_deg", d.turned_deg},
                     {"raw_deg", d.raw_deg},
                     {"rms_px", d.rms_px},
                     {"max_px", d.max_px},
                     {"lens_rms_px", d.lens_rms_px},
                     {"lens_max_px", d.lens_max_px},
                     {"gain_stops", d.gain_stops},
                     {"vignetting_stops", d.vignetting_stops},
                     {"response_levels", d.response_levels}});
    table.row({d.name == d.other ? d.name : d.name + " / " + d.other, fmt::format("{:.4f}", d.turned_deg),
               fmt::format("{:.4f}", d.raw_deg), fmt::format("{:.3f}", d.rms_px), fmt::format("{:.3f}", d.max_px),
               fmt::format("{:.3f}", d.lens_rms_px), fmt::format("{:.3f}", d.lens_max_px),
               fmt::format("{:+.3f} {:+.3f} {:+.3f}", d.gain_stops[0], d.gain_stops[1], d.gain_stops[2]),
               fmt::format("{:.3f}", d.vignetting_stops), fmt::format("{:.1f}", d.response_levels)});
  }
  Console& console = context.console();
  console.document({{"rig_turn_deg", difference.rig_turn_deg},
                    {"turned_rms_deg", difference.turned_rms_deg},
                    {"heads", heads},
                    {"notes", difference.notes}});
  for (const std::string& line : table.lines()) console.line(line);
  console.line(fmt::format("the whole rig is turned by {:.4f}°; after that the heads differ by {:.4f}° rms",
                           difference.rig_turn_deg, difference.turned_rms_deg));
  for (const std::string& note : difference.notes) console.note("note: " + note);
  return {};
}

}  // namespace

void add_calibration_diff(CLI::App& group, CommandLine& line) {
  CLI::App* diff = add_command(
      group, "diff", "Compare two calibrations, head by head; needs no rig",
      "  nodal calibration diff before.json after.json\n"
      "  nodal calibration diff a.json b.json --json | jq '.heads[].turned_deg'\n"
      "Degrees are given as they are, and after the rotation of the whole rig that brings the two\n"
      "closest; pixels are the distance of a ray's images, for rotation and lens, and for the lens alone.\n");
  auto args = std::make_shared<CalibrationDiffArgs>();
  diff->add_option("A", args->a, "The first calibration, or another program's project")->required()->type_name("");
  diff->add_option("B", args->b, "The second calibration or project")->required()->type_name("");
  line.on(diff, [args](Context& context) { return run_calibration_diff(context, *args); });
}

}  // namespace nodal::host
