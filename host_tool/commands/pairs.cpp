#include "stitch/registration/pairs.h"
#include "protocol/base/try.h"

#include <fmt/format.h>

#include "host_tool/commands/command.h"
#include "host_tool/commands/command_list.h"
#include "host_tool/console/files.h"
#include "host_tool/console/interrupt.h"
#include "host_tool/input/calibration_file.h"
#include "host_tool/input/pairs_file.h"

namespace nodal::host {
namespace {

struct PairsArgs {
  std::string calibration, csv;
  std::vector<std::string> inputs;
  std::string out = "calibration.json";
  bool focals = false, cpfind = false;
};

void tell(Console& console, const registration::PairFit& fit, const PairsArgs& args) {
  Json agreements = Json::array(), heads = Json::array();
  using Align = Table::Align;
  Table table({{"heads"},
               {"pairs", Align::kRight},
               {"rejected", Align::kRight},
               {"rms", Align::kRight},
               {"worst", Align::kRight}});
  for (const registration::PairAgreement& each : fit.agreements) {
    const std::string &a = fit.heads[each.a].name, &b = fit.heads[each.b].name;
    agreements.push_back({{"heads", {a, b}},
                          {"used", each.used},
                          {"rejected", each.rejected},
                          {"rms_deg", each.rms_deg},
                          {"worst_deg", each.worst_deg}});
    table.row({a + " " + b, std::to_string(each.used), std::to_string(each.rejected),
               fmt::format("{:.3f}°", each.rms_deg), fmt::format("{:.3f}°", each.worst_deg)});
  }
  for (const registration::HeadReport& head : fit.heads) {
    heads.push_back({{"name", head.name},
                     {"placed", head.placed},
                     {"turned_deg", head.turned_deg},
                     {"sigma_deg", head.placed ? Json(head.sigma_deg) : Json(nullptr)},
                     {"focal_change_percent", head.focal_change_percent}});
  }
  console.document({{"out", args.out},
                    {"rms_deg", fit.rms_deg},
                    {"heads", heads},
                    {"pairs", agreements},
                    {"warnings", fit.warnings}});
  for (const std::string& line : table.lines()) console.line(line);
  for (const std::string& warning : fit.warnings) console.warning(warning);
  console.line(fmt::format("the point pairs agree within {:.3f}° rms; wrote {}", fit.rms_deg, args.out));
}

Status run_pairs(Context& context, const PairsArgs& args) {
  NODAL_TRY_ASSIGN(const Calibration prior, read_calibration(args.calibration, context.console()));
  if (!args.cpfind && args.inputs.size() != 1) {
    return fail(Errc::kBadValue, "give one file with point pairs, or --cpfind and a picture of each head");
  }
  NODAL_TRY_ASSIGN(const auto pairs,
                   args.cpfind ? find_pairs(args.inputs, prior) : read_pairs(args.inputs.front(), prior));
  if (!args.csv.empty()) {
    NODAL_TRY(write_file(args.csv, pairs_csv(pairs, prior)));
  }
  NODAL_TRY_ASSIGN(const registration::PairFit fit, interruptible(context.console(), [&] {
                     return registration::fit_to_pairs(
                         prior, pairs, args.focals ? registration::Free::kFocals : registration::Free::kRotations);
                   }));
  NODAL_TRY(write_file(args.out, to_json(fit.calibration)));
  tell(context.console(), fit, args);
  return {};
}

}  // namespace

void add_pairs(CLI::App& app, CommandLine& line) {
  CLI::App* command =
      add_command(app, "pairs", "Place the heads by point pairs, at any distance from the start; needs no rig",
                  "  nodal pairs rig.json points.csv -o near.json     head_a,x_a,y_a,head_b,x_b,y_b\n"
                  "  nodal pairs rig.json project.pto                 its control points\n"
                  "  nodal pairs rig.json --cpfind cam*.png --csv points.csv\n"
                  "A start for `nodal register`, which is much more accurate.\n");
  auto args = std::make_shared<PairsArgs>();
  command->add_option("CALIBRATION", args->calibration, "The calibration: the heads and their lenses")
      ->required()
      ->type_name("");
  command
      ->add_option("INPUT", args->inputs, "Point pairs (CSV, .pto, .pts, .ptv); with --cpfind a picture of each head")
      ->required()
      ->type_name("");
  command->add_option("-o,--out", args->out, "The calibration found (calibration.json when not given)")
      ->type_name("FILE");
  command->add_flag("--focals", args->focals, "Estimate focal lengths, too");
  command->add_flag("--cpfind", args->cpfind, "Find the pairs in pictures by Hugin's cpfind");
  command->add_option("--csv", args->csv, "Write the pairs as CSV, too")->type_name("FILE");
  line.on(command, [args](Context& context) { return run_pairs(context, *args); });
}

}  // namespace nodal::host
