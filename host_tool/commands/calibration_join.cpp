#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "host_tool/commands/command.h"
#include "host_tool/commands/command_list.h"
#include "host_tool/console/files.h"
#include "host_tool/input/calibration_file.h"
#include "protocol/base/try.h"
#include "protocol/calibration.h"

namespace nodal::host {
namespace {

struct CalibrationJoinArgs {
  std::vector<std::string> files;
  std::string out = "rig.json";
};

/// The heads of all files in one calibration.
Result<Calibration> joined(Console& console, const std::vector<std::string>& files) {
  Calibration rig;
  std::vector<std::string> from;
  for (const std::string& file : files) {
    NODAL_TRY_ASSIGN(Calibration one, read_calibration(file, console));
    for (HeadCalibration& head : one.heads) {
      const auto same = std::ranges::find(rig.heads, head.name, &HeadCalibration::name);
      if (same != rig.heads.end()) {
        return fail(Errc::kBadValue,
                    fmt::format("{} and {} both have a head '{}'; name one of them differently (\"name\" in the file, "
                                "or --name of `nodal calibrate lens`)",
                                from[static_cast<std::size_t>(same - rig.heads.begin())], file, head.name));
      }
      rig.heads.push_back(std::move(head));
      from.push_back(file);
    }
    if (&file != &files.front() && one.distance != rig.distance) {
      return fail(Errc::kBadValue, fmt::format("{} is for things at {} m, and {} at {} m (`distance`; 0 m stands for "
                                               "far away); give them one distance",
                                               files.front(), rig.distance, file, one.distance));
    }
    rig.distance = one.distance;
  }
  rig.name = fmt::format("{} heads", rig.heads.size());
  rig.comment = "Lenses of single heads, joined.";
  NODAL_TRY(check_calibration(rig));
  return rig;
}

Status run_calibration_join(Context& context, const CalibrationJoinArgs& args) {
  Console& console = context.console();
  NODAL_TRY_ASSIGN(const Calibration rig, joined(console, args.files));
  NODAL_TRY(write_file(args.out, nodal::to_json(rig)));
  Json names = Json::array();
  std::string list;
  for (const HeadCalibration& head : rig.heads) {
    names.push_back(head.name);
    list += (list.empty() ? "" : ", ") + head.name;
  }
  // What one file says of directions has nothing to do with the other files.
  const bool directions = args.files.size() == 1;
  console.document({{"out", args.out}, {"heads", names}, {"directions", directions}});
  console.line(fmt::format("wrote {}: {} heads ({}), in the order of the files", args.out, rig.heads.size(), list));
  if (!directions) {
    console.line(
        fmt::format("how the heads of different files look to each other is not known; it is found in pictures: nodal "
                    "register {} PICTURES... -o registered.json",
                    args.out));
  }
  return {};
}

}  // namespace

void add_calibration_join(CLI::App& group, CommandLine& line) {
  CLI::App* join = add_command(
      group, "join", "Put the heads of several calibrations into one; needs no rig",
      "  nodal calibration join cam0.json cam1.json cam2.json -o lenses.json\n"
      "  nodal register lenses.json cam0.png cam1.png cam2.png -o rig.json     finds where they look\n"
      "`nodal calibrate lens` measures one head. Here the lenses of all heads become the calibration of a rig,\n"
      "with the heads in the order of the files, which is the order of the heads in rig.toml.\n");
  auto args = std::make_shared<CalibrationJoinArgs>();
  join->add_option("FILE", args->files, "Calibrations, or other programs' projects")->required()->type_name("");
  join->add_option("-o,--out", args->out, "The calibration of the rig (rig.json when not given)")->type_name("FILE");
  line.on(join, [args](Context& context) { return run_calibration_join(context, *args); });
}

}  // namespace nodal::host
