#include "host_tool/commands/frame_options.h"

namespace nodal::host {
namespace {

struct ConvertArgs {
  FrameOptions frames;
  std::string layout = "equirectangular";
  int width = 0;
};

Status run_convert(Context& context, const ConvertArgs& args) {
  const Result<geometry::LayoutName> to = layout_named(args.layout);
  if (!to) return fail(to.error().in("--layout"));
  std::unique_ptr<geometry::RaymapLayout> layout;
  return run_frames(context.console(), args.frames,
                    [&](const geometry::LayoutName& from, geometry::RaymapSize size) -> Result<Outcome> {
                      const double natural = to->width_for_resolution(size.width / from.width_for_resolution(1));
                      const geometry::RaymapSize made = to->size_for_width(args.width > 0 ? args.width : natural);
                      auto target = geometry::make_layout(*to, made.width, made.height);
                      if (!target) return fail(target.error().in("--layout"));
                      layout = std::move(*target);
                      return Outcome{view::Target::of(*layout), *to};
                    });
}

}  // namespace

void add_convert(CLI::App& app, CommandLine& line) {
  CLI::App* command = add_command(app, "convert", "Convert raymaps to another layout; needs no rig",
                                  "  nodal convert sphere.jpg -o cube.jpg --layout cube\n"
                                  "  nodal convert cube.png --from cube:pad=2 -o sphere.jpg\n"
                                  "  nodal convert r-*.jpg -o h-%04d.png --layout healpix --width 2048\n"
                                  "Where pixels become larger, each is a mean of what it covers.\n");
  auto args = std::make_shared<ConvertArgs>();
  add_frame_options(*command, args->frames);
  add_layout_option(*command, args->layout, "Of the result (equirectangular when not given)");
  command->add_option("--width", args->width, "Its width; as fine as the raymap when not given")
      ->type_name("PX")
      ->check(CLI::Range(16, geometry::kMaxRaymapSide));
  line.on(command, [args](Context& context) { return run_convert(context, *args); });
}

}  // namespace nodal::host
