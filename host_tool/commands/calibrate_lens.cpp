#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <numbers>
#include <thread>

#include "host_tool/commands/command.h"
#include "host_tool/commands/command_list.h"
#include "host_tool/console/files.h"
#include "host_tool/console/interrupt.h"
#include "host_tool/input/corner_lists.h"
#include "host_tool/input/pictures.h"
#include "host_tool/report/lens_report.h"
#include "protocol/base/file_ending.h"
#include "protocol/base/try.h"
#include "stitch/calibration/lens/calibrate.h"
#include "stitch/media/image_file.h"

namespace nodal::host {
namespace {

namespace cal = calibration;

struct CalibrateLensArgs {
  std::vector<std::string> photos;
  std::string model = "tsai";
  std::string out = "head.json";
  std::string name = "head0";
  std::string pattern;
  std::string report;
  double aspect = 0;
};

/// Returns the encoded luma; a grey file's values are its luma.
Result<cal::LensPhotograph> read_photograph(const std::string& file) {
  NODAL_TRY_ASSIGN(const DecodedImage image, read_picture(file, PixelFormat::kGrey8));
  cal::LensPhotograph photo{file, cal::GreyImage(image.width, image.height)};
  for (std::size_t i = 0; i < photo.luma.values.size(); ++i) {
    photo.luma.values[i] = static_cast<float>(image.bytes[i]) / 255.0F;
  }
  return photo;
}

Result<std::vector<cal::LensPhotograph>> read_photographs(const std::vector<std::string>& files) {
  std::vector<cal::LensPhotograph> photographs;
  for (const std::string& file : files) {
    NODAL_TRY_ASSIGN(cal::LensPhotograph photo, read_photograph(file));
    photographs.push_back(std::move(photo));
  }
  return photographs;
}

Result<cal::PatternRaster> read_pattern(const std::string& file) {
  if (file.empty()) return cal::make_pattern({});
  NODAL_TRY_ASSIGN(const DecodedImage image, read_picture(file, PixelFormat::kGrey8));
  if (std::min(image.width, image.height) < cal::kMinPatternSide) {
    return fail(Errc::kBadValue, fmt::format("{}: is {}x{} px; a pattern has at least {} across", file, image.width,
                                             image.height, cal::kMinPatternSide));
  }
  return cal::PatternRaster{image.width, image.height, image.bytes};
}

/// Runs work(0) .. work(count - 1) on all cores; the order does not affect the result.
void on_every_core(int count, const std::function<void(int)>& work) {
  std::atomic<int> next{0};
  const auto labour = [&] {
    for (int i = next.fetch_add(1); i < count; i = next.fetch_add(1)) work(i);
  };
  std::vector<std::thread> others;
  const int threads = static_cast<int>(std::max(1U, std::thread::hardware_concurrency()));
  for (int t = 1; t < std::min(threads, count); ++t) others.emplace_back(labour);
  labour();
  for (std::thread& other : others) other.join();
}

/// Whether corners are given instead of photographs of the pattern.
bool is_corner_list(const CalibrateLensArgs& args) {
  return args.photos.size() == 1 && has_ending(args.photos.front(), ".csv");
}

Json calibrate_lens_json(const cal::Measured& m) { return {{"value", m.value}, {"deviation", m.deviation}}; }

Json calibrate_lens_json(const cal::LensCalibration& result, const CalibrateLensArgs& args) {
  Json views = Json::array();
  for (const cal::ViewReport& view : result.report.views) {
    views.push_back({{"file", view.name},
                     {"points", view.pairs},
                     {"tilt_deg", view.tilt_deg},
                     {"distance", view.distance},
                     {"blur_px", view.blur_px},
                     {"covered", view.covered},
                     {"explained", view.explained},
                     {"rms_levels", view.rms},
                     {"rms_px", view.rms_px},
                     {"gain", view.gain}});
  }
  const cal::LensReport& report = result.report;
  return {{"out", args.out},
          {"model", args.model},
          {"focal_px", calibrate_lens_json(report.focal)},
          {"center_x_px", calibrate_lens_json(report.center_x)},
          {"center_y_px", calibrate_lens_json(report.center_y)},
          {"aspect", calibrate_lens_json(report.aspect)},
          {"mapping_deviation_px", report.mapping_deviation_px},
          {"covered", report.covered},
          {"seen_px", {report.seen_from_px, report.seen_to_px}},
          {"views", views},
          {"notes", report.notes}};
}

std::string show(const cal::Measured& m, const char* unit) {
  return fmt::format("{:.4f} ± {:.4f}{}", m.value, m.deviation, unit);
}

std::string show_response(const Response& response) {
  if (response.curve == Response::Curve::kGamma) return fmt::format("gamma {:.3f}", response.gamma);
  std::string text = "light =";
  for (std::size_t k = 0; k < response.coefficients.size(); ++k) {
    text += fmt::format(" {:+.3f} e^{}", response.coefficients[k], k + 1);
  }
  return text;
}

void tell(Console& console, const cal::LensCalibration& result, const CalibrateLensArgs& args) {
  console.document(calibrate_lens_json(result, args));
  Table table({{"photograph"},
               {"points", Table::Align::kRight},
               {"tilt", Table::Align::kRight},
               {"distance", Table::Align::kRight},
               {"blur px", Table::Align::kRight},
               {"covers", Table::Align::kRight},
               {"explained", Table::Align::kRight},
               {"left over", Table::Align::kRight}});
  for (const cal::ViewReport& view : result.report.views) {
    table.row({view.name, std::to_string(view.pairs), fmt::format("{:.1f}°", view.tilt_deg),
               fmt::format("{:.3f}", view.distance), fmt::format("{:.2f}", view.blur_px),
               fmt::format("{:.0f} %", 100 * view.covered), fmt::format("{:.2f} %", 100 * view.explained),
               fmt::format("{:.1f}/255", view.rms)});
  }
  Table corners({{"photograph"},
                 {"corners", Table::Align::kRight},
                 {"tilt", Table::Align::kRight},
                 {"left over", Table::Align::kRight}});
  for (const cal::ViewReport& view : result.report.views) {
    corners.row({view.name, std::to_string(view.pairs), fmt::format("{:.1f}°", view.tilt_deg),
                 fmt::format("{:.2f} px", view.rms_px)});
  }
  for (const std::string& line : (is_corner_list(args) ? corners : table).lines()) console.line(line);
  const HeadCalibration& head = result.head;
  const cal::LensReport& report = result.report;
  const auto& v = head.vignetting.coefficients;
  console.line("");
  console.line(fmt::format("focal length  {}", show(report.focal, args.model == "tsai" ? " px" : " px/rad")));
  console.line(fmt::format("centre        {}, {}", show(report.center_x, ""), show(report.center_y, " px")));
  console.line(fmt::format("aspect        {:.6f} ± {:.6f}", report.aspect.value, report.aspect.deviation));
  console.line(
      fmt::format("mapping       ± {:.4f} px over the picture, {:.0f} % of it seen, {:.0f} to {:.0f} px from "
                  "the centre",
                  report.mapping_deviation_px, 100 * report.covered, report.seen_from_px, report.seen_to_px));
  if (is_corner_list(args)) console.line("light         not measured by corners; sRGB is taken");
  else
    console.line(fmt::format("light         {}; {:.2f} of it left in the farthest corner", show_response(head.response),
                             1 + v[0] + v[1] + v[2]));
  if (head.region.circle) {
    console.line(fmt::format("region        a circle about {:.1f}, {:.1f} of {:.1f} px", head.region.circle->x,
                             head.region.circle->y, head.region.circle->radius));
  } else {
    console.line(fmt::format("region        {:.0f}, {:.0f} to {:.0f}, {:.0f}", head.region.left, head.region.top,
                             head.region.right, head.region.bottom));
  }
  for (const std::string& note : report.notes) console.note("note: " + note);
  console.line("wrote " + args.out + (args.report.empty() ? "" : " and " + args.report));
}

/// The calibration of this one head in its file.
Status write_lens(const CalibrateLensArgs& args, const cal::LensCalibration& result, const std::string& source) {
  Calibration calibration;
  calibration.name = args.name;
  calibration.comment = fmt::format(
      "Lens of {}; mapping ± {:.4f} px; seen {:.0f} to {:.0f} px from its centre, and extrapolated elsewhere.", source,
      result.report.mapping_deviation_px, result.report.seen_from_px, result.report.seen_to_px);
  calibration.heads.push_back(result.head);
  NODAL_TRY(check_calibration(calibration));
  return write_file(args.out, nodal::to_json(calibration));
}

Status run_on_corners(Context& context, const CalibrateLensArgs& args, const cal::LensOptions& options) {
  const std::string& file = args.photos.front();
  if (!args.report.empty()) return fail(Errc::kUnsupported, "--report: needs photographs of the pattern, not corners");
  NODAL_TRY_ASSIGN(CornerList list, interruptible(context.console(), [&] { return read_corner_list(file); }));
  const std::string source = fmt::format("the corners of a board in {} photographs", list.views.size());
  const auto result = interruptible(context.console(), [&] {
    return cal::calibrate_on_corners(std::move(list.views), list.width, list.height, options);
  });
  if (!result) return fail(result.error().in(file));
  NODAL_TRY(write_lens(args, *result, source));
  tell(context.console(), *result, args);
  return {};
}

Status run_calibrate_lens(Context& context, const CalibrateLensArgs& args) {
  NODAL_TRY_ASSIGN(const cal::LensKind kind, cal::lens_kind_named(args.model));
  cal::LensOptions options;
  options.kind = kind;
  options.head_name = args.name;
  options.aspect_known = args.aspect > 0;
  if (args.aspect > 0) options.aspect = args.aspect;
  options.for_each = on_every_core;
  if (is_corner_list(args)) return run_on_corners(context, args, options);
  NODAL_TRY_ASSIGN(const cal::PatternRaster pattern, read_pattern(args.pattern));
  NODAL_TRY_ASSIGN(const auto photographs,
                   interruptible(context.console(), [&] { return read_photographs(args.photos); }));
  Result<cal::LensCalibration> result = fail(Errc::kInternal, "");
  {
    Progress progress(context.console(), "calibrating", 100);
    options.progress = [&progress](const std::string& what, double done) {
      progress.update(static_cast<std::uint64_t>(std::lround(100 * done)), what);
    };
    result = interruptible(context.console(), [&] { return cal::calibrate_lens(photographs, pattern, options); });
  }
  if (!result) return fail(result.error());
  NODAL_TRY(write_lens(args, *result, fmt::format("{} photographs of the pattern", photographs.size())));
  if (!args.report.empty()) {
    NODAL_TRY_ASSIGN(const std::string page,
                     interruptible(context.console(), [&] { return lens_report(*result, args.model); }));
    NODAL_TRY(write_file(args.report, page));
  }
  tell(context.console(), *result, args);
  return {};
}

}  // namespace

void add_calibrate(CLI::App& app, CommandLine& line) {
  CLI::App* group = add_command(app, "calibrate", "Measure lenses and light of heads; needs no rig", "");
  group->require_subcommand(1);
  CLI::App* lens =
      add_command(*group, "lens", "A head's lens from photographs of the pattern",
                  "  nodal calibrate lens photo*.png --name cam5 -o cam5.json --report cam5.html\n"
                  "  nodal calibrate lens fish*.jpg --model kannala_brandt --aspect 1\n"
                  "  nodal calibrate lens corners.csv --model kannala_brandt\n"
                  "Take three to eight photographs of the printed pattern (`nodal pattern`): sharp, focus and zoom\n"
                  "as they will be used, the pattern filling the picture and its corners, turned by 20 to 40 degrees\n"
                  "to different sides, lit evenly. Every pixel of them is aligned, so no points need be marked.\n"
                  "Your own board: corners.csv lists its corners as another program found them, such as OpenCV, a row\n"
                  "each: picture,x,y,board_x,board_y. See the manual page.\n");
  auto args = std::make_shared<CalibrateLensArgs>();
  lens->add_option("PHOTOS", args->photos,
                   "Photographs of the pattern: JPEG, PNG, TIFF, HEIF or WebP; or a list of corners, .csv")
      ->required()
      ->type_name("");
  lens->add_option("--model", args->model, "tsai, equidistant or kannala_brandt (tsai when not given)")
      ->type_name("tsai|equidistant|kannala_brandt")
      ->check(checked_by([](std::string_view name) { return cal::lens_kind_named(name); }));
  lens->add_option("-o,--out", args->out, "File of the calibration, of this one head (head.json when not given)")
      ->type_name("FILE");
  lens->add_option("--name", args->name, "The head's name (head0 when not given)")->type_name("NAME");
  lens->add_option("--pattern", args->pattern, "The picture that was printed or shown, when it is not the usual one")
      ->type_name("FILE");
  lens->add_option("--aspect", args->aspect, "f_y / f_x when it is known, 1 for square pixels; sought when not given")
      ->type_name("RATIO")
      ->check(CLI::Range(0.2, 5.0));
  lens->add_option("--report", args->report, "A page to look at, too: one HTML file with residual maps and curves")
      ->type_name("FILE");
  line.on(lens, [args](Context& context) { return run_calibrate_lens(context, *args); });

  add_calibrate_light(*group, line);
}

}  // namespace nodal::host
