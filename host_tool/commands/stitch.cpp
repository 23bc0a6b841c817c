#include <fmt/format.h>

#include <charconv>

#include "host_tool/commands/command.h"
#include "host_tool/commands/command_list.h"
#include "host_tool/commands/layout_option.h"
#include "host_tool/commands/nominal_options.h"
#include "host_tool/commands/picture_places_option.h"
#include "host_tool/commands/sphere_options.h"
#include "host_tool/commands/stitch_film.h"
#include "host_tool/commands/stitch_job.h"
#include "host_tool/commands/stitch_pictures.h"
#include "protocol/base/try.h"
#include "stitch/geometry/raymap/layout.h"

namespace nodal::host {
namespace {

/// The value of --quality that chose the blend before there was --blend.
constexpr const char* kBestAsQuality = "best";
/// The older word for --blend board.
constexpr const char* kBoardAsRig = "rig";

/// Unlike CLI::Range it refuses NaN.
CLI::Validator number_between(double least, double most) {
  return checked_by([least, most](const std::string& text) -> Result<double> {
    double value = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    if (error == std::errc() && end == text.data() + text.size() && value >= least && value <= most) return value;
    return fail(Errc::kBadValue, fmt::format("'{}': it must be a number from {:g} to {:g}", text, least, most));
  });
}

Status run_stitch(Context& context, const StitchArgs& args) {
  Console& console = context.console();
  NODAL_TRY_ASSIGN(const StitchedPictures made, stitch_pictures(console, args));
  console.document(made.document);
  for (const std::string& line : made.lines) console.line(line);
  return {};
}

}  // namespace

void add_stitch(CLI::App& app, CommandLine& line) {
  CLI::App* command = add_command(
      app, "stitch", "Make a sphere from pictures, or a film of it from films; needs no rig",
      "  nodal stitch a.jpg b.jpg c.jpg -o sphere.jpg             finds lens and directions in the pictures\n"
      "  nodal stitch theta.jpg -o sphere.jpg                     one file with the two circles of a 360-degree "
      "camera\n"
      "  nodal stitch rig.json cam0.jpg cam1.jpg cam2.jpg         with a calibration\n"
      "  nodal stitch project.pts                                 with the pictures that the project names\n"
      "  nodal stitch rig.json take/0001 take/0002 -o s-%04d.jpg  folders with pictures named after the heads\n"
      "  nodal stitch rig.json front/ back/ -o s-%04d.jpg         a folder for each head, with a sequence\n"
      "  nodal stitch front/ back/ -o s-%04d.jpg                  the same, calibrated by the middle of it\n"
      "  nodal stitch rig.json cam*.png --layout cube --bits 16 -o light.png\n"
      "  nodal stitch --nominal 2x190 front.jpg back.jpg          two fisheyes of 190 degrees, back to back\n"
      "  nodal stitch rig.json cam*.png --blend board             the pixels that the rig's board makes\n"
      "  nodal stitch rig.json cam0.mp4 cam1.mp4 -o sphere.mp4    a film, from a film of each head\n"
      "  nodal stitch cam0.mp4 cam1.mp4 cam2.mp4 -o sphere.mp4    the same, calibrated where little moves\n"
      "  nodal stitch theta.mp4 -o sphere.mp4                     a film with the two circles of a 360-degree camera\n"
      "Without a calibration, the pictures must be of equal lenses at one place and overlap; the calibration\n"
      "that is found (sphere.rig.json) and a report (sphere.report.html) are written beside the result.\n"
      "A calibration is Nodal's own, or a project of Hugin (.pto), PTGui (.pts), VideoStitch (.ptv),\n"
      "Surround360, OpenCV or Kalibr. Sets are taken as a film: seams stay in place where they can.\n"
      "What is black in a.mask.png beside a.jpg, or transparent in a picture, is not used.\n"
      "The last line but one says how the first sphere looks at its seams: good, usable, or where to look.\n");
  auto args = std::make_shared<StitchArgs>();
  command
      ->add_option(
          "INPUT", args->inputs,
          "Pictures; or a calibration or a project, then one picture for each of its heads, in its order; or folders")
      ->required()
      ->type_name("");
  command
      ->add_option(
          "-o,--out", args->out,
          "The picture, .jpg, .png, .tif or .raw (sphere.jpg when not given); %04d numbers it; or a film, .mp4,\n"
          ".mov or .mkv")
      ->type_name("FILE");
  add_layout_option(*command, args->layout, "Layout of the result (equirectangular when not given)");
  command
      ->add_option(
          "--width", args->width,
          "Width of the result, or of the sphere that it is cropped from; as fine as the pictures when not given, but\n"
          "no side longer than 16000")
      ->type_name("PX")
      ->check(CLI::Range(16, geometry::kMaxRaymapSide));
  command->add_option("--bits", args->bits, "8 (when not given), or 16: numbers proportional to light")
      ->type_name("8|16")
      ->check(CLI::IsMember({8, 16}));
  CLI::Option* const blend = command->add_option(
      "--blend", args->blend,
      "best (when not given): seams where the pictures agree, blended in many bands; takes 60 bytes of memory for\n"
      "each pixel of the result. board: the pixels that the rig's board makes of these pictures; faster");
  blend->type_name("best|board")->check(CLI::IsMember({"best", "board"}))->transform([](const std::string& word) {
    return word == kBoardAsRig ? std::string("board") : word;
  });
  command->add_option("--quality", args->quality, "JPEG quality, 1 to 100 (95 when not given; 92 with --blend board)")
      ->type_name("N")
      ->check(checked_by([](const std::string& text) -> Status {
        int value = 0;
        const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
        if (error == std::errc() && end == text.data() + text.size() && value >= 1 && value <= 100) return {};
        if (text == kBestAsQuality) return {};
        return fail(Errc::kBadValue, fmt::format("'{}': it must be a whole number from 1 to 100", text));
      }));
  CLI::Option* const transition = command->add_option(
      "--transition", args->transition,
      "Where heads overlap: two-band (when not given), sharp without a step in brightness; seam, sharp;\n"
      "feather, mixed over the overlap");
  transition->type_name("two-band|seam|feather")->check(CLI::IsMember({"two-band", "seam", "feather"}));
  CLI::Option* const seam_width =
      command->add_option("--seam-width", args->seam_width_deg,
                          "How wide the change is from one head's detail to the next one's (1 when not given)");
  seam_width->type_name("DEGREES")->check(number_between(0, table::kWidestSeamDeg));
  CLI::Option* const feather = command->add_option(
      "--feather", args->feather,
      "With two-band and feather: from its edge to this part of half a picture, a head counts more and more\n"
      "(0.5 when not given)");
  feather->type_name("PART")->check(number_between(0.01, 1));
  command
      ->add_option("--threads", args->threads,
                   "Number of threads (one for each core when not given); the result is the same")
      ->type_name("N")
      ->check(CLI::Range(1, 256));
  command
      ->add_option(
          "--distance", args->distance,
          "Distance at which the heads' pictures fit, metres; needs a calibration in which heads have positions")
      ->type_name("M")
      ->check(number_between(0.01, kLongestDistance));
  command
      ->add_option("--crop", args->crop,
                   "auto (when not given): to what the pictures show, if that is less than 60 % of the sphere; none;\n"
                   "or a part of the whole equirectangular picture, px")
      ->type_name("auto|none|X,Y,W,H")
      ->check(checked_by(parse_crop));
  add_split_option(*command, args->split);
  add_up_option(*command, args->up);
  add_picture_places(*command, args->places);
  add_nominal_options(*command, args->nominal);
  auto film = std::make_shared<FilmArgs>();
  add_film_options(*command, *film);
  command->parse_complete_callback([=] {
    const bool chosen = !blend->empty() || args->quality == kBestAsQuality;
    if (args->quality == kBestAsQuality) {
      if (!blend->empty() && !best(*args)) {
        throw CLI::ValidationError(blend->get_name(), "--quality best is an older word for --blend best; leave it out");
      }
      args->blend = "best";
      args->quality.clear();
    }
    for (const CLI::Option* other : {transition, seam_width, feather}) {
      if (other->empty()) continue;
      if (!chosen) args->blend = "board";
      if (!best(*args)) continue;
      throw CLI::ValidationError(other->get_name(),
                                 "--blend best passes from head to head in many bands; leave one of the two out");
    }
  });
  line.on(command, [args, film](Context& context) {
    return makes_film(args->out) ? run_film(context, *args, *film) : run_stitch(context, *args);
  });
}

}  // namespace nodal::host
