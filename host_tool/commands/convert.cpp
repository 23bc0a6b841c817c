#include <fmt/format.h>

#include <filesystem>

#include "host_tool/commands/command_list.h"
#include "host_tool/commands/frame_options.h"
#include "host_tool/console/files.h"
#include "host_tool/console/overwriting.h"
#include "host_tool/input/nominal_rig.h"
#include "protocol/base/try.h"
#include "protocol/calibration.h"
#include "stitch/geometry/rotation.h"
#include "stitch/geometry/turned_rig.h"

namespace nodal::host {
namespace {

struct ConvertArgs {
  FrameOptions frames;
  std::string layout = "equirectangular";
  std::string rotate;  ///< empty: the sphere is not turned
  int width = 0;
};

/// The calibration that `nodal stitch` wrote beside a sphere, and where it goes when the sphere is turned.
struct Companion {
  std::string from, to;
  Calibration turned;
};

/// Nothing if there is none. Errors: those of reading it; kExists.
Result<std::optional<Companion>> companion_of(const FrameOptions& frames, const Eigen::Matrix3d& R_new_old) {
  const auto beside = [](const std::string& picture) {
    return std::filesystem::path(picture).replace_extension(".rig.json").string();
  };
  Companion companion{beside(frames.inputs.front()), beside(frames.out), {}};
  std::error_code error;
  if (frames.inputs.size() > 1 || frames.out == "-" || !std::filesystem::is_regular_file(companion.from, error))
    return std::nullopt;
  NODAL_TRY(check_free(companion.to));
  NODAL_TRY_ASSIGN(const std::string json, read_file(companion.from, kMaxCalibrationBytes));
  Result<Calibration> read = parse_calibration(json);
  if (!read) return fail(read.error().in(companion.from));
  companion.turned = geometry::turned_rig(std::move(*read), R_new_old);
  return companion;
}

Status run_convert(Context& context, const ConvertArgs& args) {
  Console& console = context.console();
  const Result<geometry::LayoutName> to = layout_named(args.layout);
  if (!to) return fail(to.error().in("--layout"));
  std::unique_ptr<geometry::RaymapLayout> layout;
  std::optional<Eigen::Matrix3d> R_new_old;
  std::optional<Companion> companion;
  if (!args.rotate.empty()) {
    const NominalPlace place = parse_place(args.rotate).value();
    R_new_old = geometry::to_R_head_rig({place.yaw, place.pitch, place.roll});
    NODAL_TRY_ASSIGN(companion, companion_of(args.frames, *R_new_old));
  }
  const auto outcome = [&](double pixels_per_radian) -> Result<Outcome> {
    const double natural = to->width_for_resolution(pixels_per_radian);
    const geometry::RaymapSize made = to->size_for_width(args.width > 0 ? args.width : natural);
    if (args.width > 0 && made.width != args.width) {
      console.note(fmt::format("note: --width {}: the next width of this layout is {}", args.width, made.width));
    }
    auto target = geometry::make_layout(*to, made.width, made.height);
    if (!target) return fail(target.error().in("--layout"));
    layout = std::move(*target);
    Outcome all{view::Target::of(*layout), *to};
    if (!R_new_old) return all;
    all.R_new_old = R_new_old;
    all.target.ray = [&, ray = all.target.ray](double x, double y) -> std::optional<geometry::Ray> {
      const std::optional<geometry::Ray> now = ray(x, y);
      if (!now) return std::nullopt;
      return geometry::Ray::towards(R_new_old->transpose() * now->direction());
    };
    return all;
  };
  NODAL_TRY(run_frames(console, args.frames, outcome));
  if (!companion) return {};
  NODAL_TRY(write_file(companion->to, to_json(companion->turned)));
  console.line("calibration: " + companion->to + ", which is " + companion->from + " turned likewise");
  return {};
}

}  // namespace

void add_convert(CLI::App& app, CommandLine& line) {
  CLI::App* command =
      add_command(app, "convert", "Convert spheres to another layout, or turn them; needs no rig",
                  "  nodal convert sphere.jpg -o cube.jpg --layout cube\n"
                  "  nodal convert cube.png --from cube:pad=2 -o sphere.jpg\n"
                  "  nodal convert sphere.jpg -o town.jpg --layout faces      town_right.jpg and five more\n"
                  "  nodal convert town_*.jpg -o sphere.jpg --from faces\n"
                  "  nodal convert sphere.jpg -o level.jpg --rotate 0,-3,1.5\n"
                  "  nodal convert theta.jpg -o sphere.jpg --from dual_fisheye:fov=190\n"
                  "  nodal convert r-*.jpg -o h-%04d.png --layout healpix --width 2048\n"
                  "Where pixels become larger, each is a mean of what it covers.\n");
  auto args = std::make_shared<ConvertArgs>();
  add_frame_options(*command, args->frames);
  add_layout_option(
      *command, args->layout,
      "Layout of the result (equirectangular when not given); faces: six files of a cube, town_right.jpg, _left,\n"
      "_up, _down, _front and _back for -o town.jpg")
      ->transform([args](const std::string& text) {
        args->frames.faces_out = text == kFacesWord;
        return std::string(args->frames.faces_out ? kFacesLayout : text);
      });
  command
      ->add_option("--rotate", args->rotate,
                   "Turn the sphere: the middle of the result is what is YAW degrees to the right and PITCH above the\n"
                   "middle of the sphere, looked at with ROLL clockwise; the pose in its metadata follows, and\n"
                   "sphere.rig.json beside sphere.jpg is written for the result, turned likewise")
      ->type_name("YAW,PITCH,ROLL")
      ->check(checked_by(parse_place));
  command->add_option("--width", args->width, "Width of the result; as fine as the sphere when not given")
      ->type_name("PX")
      ->check(CLI::Range(16, geometry::kMaxRaymapSide));
  line.on(command, [args](Context& context) { return run_convert(context, *args); });
}

}  // namespace nodal::host
