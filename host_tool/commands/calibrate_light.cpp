#include "stitch/calibration/light/calibrate_light.h"
#include "protocol/base/try.h"

#include <fmt/format.h>

#include <cmath>

#include "host_tool/commands/command.h"
#include "host_tool/commands/command_list.h"
#include "host_tool/console/files.h"
#include "host_tool/console/interrupt.h"
#include "host_tool/input/rig_pictures.h"

namespace nodal::host {
namespace {

namespace cal = calibration;

struct CalibrateLightArgs {
  std::string file;
  std::vector<std::string> pictures;
  std::vector<double> stops;
  std::string out = "light.json";
  cal::LightOptions options;
};

std::string show_curve(const Response& response) {
  switch (response.curve) {
    case Response::Curve::kLinear: return "linear";
    case Response::Curve::kSrgb: return "sRGB";
    case Response::Curve::kGamma: return fmt::format("gamma {:.3f}", response.gamma);
    case Response::Curve::kPolynomial: break;
  }
  std::string text = "light =";
  for (std::size_t k = 0; k < response.coefficients.size(); ++k) {
    text += fmt::format(" {:+.3f} e^{}", response.coefficients[k], k + 1);
  }
  return text;
}

Json calibrate_light_json(const cal::LightReport& report, const CalibrateLightArgs& args) {
  Json heads = Json::array();
  for (const cal::HeadLight& head : report.heads) {
    heads.push_back({{"name", head.name},
                     {"placed", head.placed},
                     {"shared_rays", head.shared},
                     {"gain_stops", head.gain_stops},
                     {"sigma_gain_stops", head.sigma_gain_stops},
                     {"corner_stops", head.corner_stops},
                     {"sigma_corner_stops", head.sigma_corner_stops},
                     {"before_stops", head.before_stops},
                     {"after_stops", head.after_stops}});
  }
  return {{"out", args.out},
          {"response_found", report.response_found},
          {"sigma_gamma", report.sigma_gamma},
          {"response_left_stops", report.response_left_stops},
          {"before_stops", report.before_stops},
          {"after_stops", report.after_stops},
          {"heads", heads},
          {"notes", report.notes}};
}

void tell(Console& console, const cal::LightReport& report, const CalibrateLightArgs& args) {
  console.document(calibrate_light_json(report, args));
  const auto right = Table::Align::kRight;
  Table table({{"head"},
               {"gain stops r", right},
               {"g", right},
               {"b", right},
               {"±", right},
               {"corner stops", right},
               {"±", right},
               {"shared rays", right},
               {"before", right},
               {"after", right}});
  for (const cal::HeadLight& head : report.heads) {
    table.row({head.name, fmt::format("{:+.3f}", head.gain_stops[0]), fmt::format("{:+.3f}", head.gain_stops[1]),
               fmt::format("{:+.3f}", head.gain_stops[2]),
               head.placed ? fmt::format("{:.3f}", head.sigma_gain_stops[1]) : "-",
               fmt::format("{:.3f}", -head.corner_stops), fmt::format("{:.3f}", head.sigma_corner_stops),
               std::to_string(head.shared), fmt::format("{:.3f}", head.before_stops),
               fmt::format("{:.3f}", head.after_stops)});
  }
  for (const std::string& line : table.lines()) console.line(line);
  const Response& first = report.calibration.heads[0].response;
  console.line(
      report.response_found
          ? fmt::format("response  {}; exposures agree to {:.3f} stops", show_curve(first), report.response_left_stops)
          : fmt::format("response  {}, as it was; --stops would find it", show_curve(first)));
  console.line(
      fmt::format("shared rays differed by {:.3f} stops rms, now by {:.3f}", report.before_stops, report.after_stops));
  for (const std::string& note : report.notes) console.note("note: " + note);
  console.line("wrote " + args.out);
}

Status run_calibrate_light(Context& context, const CalibrateLightArgs& args) {
  std::vector<std::string> inputs{args.file};
  inputs.insert(inputs.end(), args.pictures.begin(), args.pictures.end());
  NODAL_TRY_ASSIGN(RigPictures rig, interruptible(context.console(), [&] { return read_all_pictures({}, inputs); }));
  for (const std::string& note : rig.notes) context.console().note("note: " + note);
  if (!args.stops.empty() && args.stops.size() != rig.sets.size()) {
    return fail(Errc::kBadValue, fmt::format("--stops has {} numbers for {} sets of pictures; give one for each",
                                             args.stops.size(), rig.sets.size()));
  }
  std::vector<DecodedImage> colours;
  std::vector<cal::ExposedSet> sets;
  for (std::size_t i = 0; i < rig.sets.size(); ++i) {
    cal::ExposedSet set{fmt::format("set {}", i + 1), {}, {}};
    for (HeadPicture& picture : rig.sets[i]) {
      colours.push_back(in_format(picture.take(), PixelFormat::kRgb24));
      set.frames.push_back(colours.back().view());
    }
    if (!args.stops.empty()) set.stops = args.stops[i];
    sets.push_back(std::move(set));
  }
  NODAL_TRY_ASSIGN(const cal::LightReport report, interruptible(context.console(), [&] {
                     return cal::calibrate_light(rig.calibration, sets, args.options);
                   }));
  NODAL_TRY(write_file(args.out, nodal::to_json(report.calibration)));
  tell(context.console(), report, args);
  return {};
}

}  // namespace

void add_calibrate_light(CLI::App& group, CommandLine& line) {
  CLI::App* light = add_command(
      group, "light", "The heads' gains, fall-off and response, from what they see in common",
      "  nodal calibrate light rig.json shot -o lit.json\n"
      "  nodal calibrate light rig.json dark middle bright --stops -1,0,1 -o lit.json\n"
      "A folder holds one picture of every head, called like the head, all taken at one moment; pictures can be\n"
      "named themselves, too, in the calibration's order, set after set. One set gives gains and fall-off; several\n"
      "under known exposures give the response too: the same calm scene, a stop or two apart. +1 is twice the\n"
      "light.\n");
  auto args = std::make_shared<CalibrateLightArgs>();
  light->add_option("FILE", args->file, "The calibration, registered")->required()->type_name("");
  light->add_option("PICTURES", args->pictures, "Folders with pictures named after the heads, or the pictures")
      ->required()
      ->type_name("");
  light->add_option("--stops", args->stops, "How much more light each set got, in stops, such as -1,0,1")
      ->delimiter(',')
      ->type_name("LIST")
      ->check(CLI::Range(-20.0, 20.0));
  light->add_flag("--own-vignetting", args->options.own_vignetting, "A fall-off for each head, for unlike lenses");
  light->add_flag("--own-response", args->options.own_response, "A response for each head, for unlike sensors");
  light->add_option("-o,--out", args->out, "The calibration with its light (light.json when not given)")
      ->type_name("FILE");
  line.on(light, [args](Context& context) { return run_calibrate_light(context, *args); });
}

}  // namespace nodal::host
