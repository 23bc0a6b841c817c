// `nodal render`: a take's sets as raymaps.
#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <memory>
#include <optional>
#include <utility>

#include "host_tool/commands/command.h"
#include "host_tool/commands/command_list.h"
#include "host_tool/commands/layout_option.h"
#include "host_tool/commands/render_cost.h"
#include "host_tool/commands/render_film.h"
#include "host_tool/commands/take_argument.h"
#include "host_tool/console/files.h"
#include "host_tool/console/interrupt.h"
#include "host_tool/console/quantities.h"
#include "host_tool/input/calibration_file.h"
#include "host_tool/output/raymap_sink.h"
#include "protocol/base/file_ending.h"
#include "protocol/base/try.h"
#include "stitch/media/gpano.h"
#include "stitch/media/jpeg_writer.h"
#include "stitch/parallel/workers.h"
#include "stitch/render/take_render.h"
#include "stitch/sets/full_exposure.h"
#include "stitch/sets/shown_raymap.h"

namespace nodal::host {
namespace {

struct RenderArgs {
  std::string folder;
  std::string out;
  std::string calibration;
  std::string layout;
  int width = 0;
  int quality = 0;
  std::string from;
  std::string to;
  int threads = 0;
  TakeFilmArgs film;
};

/// The take's [raymap] with what the arguments change in it.
Result<RaymapConfig> wanted_raymap(const media::TakeFolder& folder, const RenderArgs& args) {
  Result<RaymapConfig> raymap = render::raymap_of(folder);
  const bool small = args.film.coding.preview && args.width == 0;
  if (!raymap || (args.layout.empty() && args.width == 0 && args.quality == 0 && !small)) return raymap;
  const std::string layout = args.layout.empty() ? raymap->layout : args.layout;
  const Result<geometry::LayoutName> name = layout_named(layout);
  if (!name) return fail(name.error().in("--layout"));
  NODAL_TRY_ASSIGN(const geometry::LayoutName before, geometry::LayoutName::parse(raymap->layout));
  if (args.quality != 0) raymap->jpeg_quality = args.quality;
  if (args.layout.empty() && args.width == 0 && !small) return raymap;
  // As fine as the rig's own, unless a width is given.
  const double natural = name->width_for_resolution(raymap->width / before.width_for_resolution(1));
  const double chosen = small ? std::min<double>(natural, kPreviewWidth) : natural;
  const geometry::RaymapSize size = name->size_for_width(args.width > 0 ? args.width : chosen);
  raymap->layout = name->text();
  raymap->width = size.width;
  raymap->height = size.height;
  return raymap;
}

bool is_film(const std::string& out) { return has_ending(out, ".mkv"); }

/// A film is made when its first raymap is there: Ctrl-C before that leaves no empty file.
Result<RaymapSink> make_sink(const std::string& out) {
  RaymapSink sink;
  if (is_film(out)) return sink;
  const auto format = media::raymap_format_of_name(out);
  if (!format) return fail(format.error().in("--out"));
  if (const Result<std::string> name = numbered_name(out, 1); !name) return fail(name.error().in("--out"));
  sink.format = *format;
  sink.pattern = out;
  return sink;
}

media::RaymapMeta meta_of(const render::RenderedRaymap& rendered, const media::TakeSet& set,
                          const Sha256& calibration) {
  media::RaymapMeta meta;
  meta.set = set.evidence.number();
  meta.mid_exposure_ns = static_cast<std::uint64_t>(std::max<std::int64_t>(0, rendered.mid_exposure.ns()));
  meta.calibration_id = calibration;
  meta.heads_mask = rendered.heads;
  meta.spread_ns = set.evidence.spread_ns();
  meta.genlock = set.evidence.genlock();
  if (set.evidence.has_pulse()) meta.trigger = set.evidence.pulse();
  for (std::size_t i = 0; rendered.heads >> i != 0; ++i) {
    const bool present = (rendered.heads >> i & 1) != 0;
    const media::TakeFrame& head = set.heads[i];
    meta.offset_ns.push_back(present ? head.offset.ns() : 0);
    meta.exposure_ns.push_back(present ? static_cast<std::uint64_t>(head.exposure.duration().ns()) : 0);
    meta.gain_mdb.push_back(present ? head.gain.mdb() : 0);
  }
  if (rendered.field) {
    meta.field = static_cast<std::uint32_t>(*rendered.field);
    meta.parity = field_parity_name(rendered.parity);
  }
  if (rendered.linear && rendered.linear->full) {
    meta.full_exposure_ns = sets::full_exposure_ns(*rendered.linear->full);
  }
  return meta;
}

/// Completes raymaps: as JPEGs, or with their pixels as they are.
class RaymapMaker {
 public:
  RaymapMaker(const RaymapConfig& raymap, bool jpeg) : raymap_(raymap), jpeg_(jpeg) {}

  /// `rate`: of raymaps.
  Result<media::Raymap> make(const render::RenderedRaymap& rendered, const media::TakeSet& set,
                             const Sha256& calibration, std::optional<FrameRate> rate) {
    media::Raymap raymap{meta_of(rendered, set, calibration), {}};
    raymap.meta.coding = jpeg_ ? "jpeg" : std::string(pixel_format_name(raymap_.format));
    raymap.meta.width = raymap_.width;
    raymap.meta.height = raymap_.height;
    raymap.meta.layout = raymap_.layout;
    raymap.meta.rate = rate;
    if (!jpeg_) {
      raymap.bytes = rendered.pixels.bytes;
      return raymap;
    }
    if (!writer_) {
      writer_ = std::make_unique<media::JpegWriter>(
          media::JpegSpec{in_8_bits(raymap_.format), raymap_.width, raymap_.height, raymap_.jpeg_quality,
                          media::raymap_packet(raymap_.layout, raymap_.width, raymap_.height)});
    }
    const std::string comment =
        fmt::format("nodal render set={} calibration={}", set.evidence.number(), to_hex(calibration));
    const ImageView shown = shown_.in_8_bits(rendered.pixels.view(), rendered.linear);
    NODAL_TRY(writer_->write(shown, comment, raymap.bytes));
    return raymap;
  }

 private:
  const RaymapConfig raymap_;
  const bool jpeg_;
  std::unique_ptr<media::JpegWriter> writer_;
  sets::ShownRaymap shown_;
};

struct Rendered {
  std::uint64_t raymaps = 0;
  std::uint64_t undecodable = 0;  ///< pictures of heads
  std::uint64_t incomplete = 0;   ///< raymaps that lack a head
  std::string last;               ///< file
};

/// "without a head in 3, ..."; empty: nothing is missing.
void tell_losses(Console& console, const render::TakeRender& render, const Rendered& done) {
  if (done.incomplete != 0) {
    console.note(
        fmt::format("{} lack a head: it delivered no picture for the set", counted(done.incomplete, "raymap")));
  }
  if (done.undecodable != 0) {
    console.note(fmt::format("{} could not be decoded and are missing", counted(done.undecodable, "picture")));
  }
  if (!render.is_of_take()) {
    console.note(
        fmt::format("note: all raymaps here are made with calibration {}, and none was when the take was recorded",
                    to_hex(render.calibration()).substr(0, 12)));
  }
}

/// Says what a costly raymap needs; refuses one that needs more memory than is free.
Status check_memory(Console& console, const render::TakeRender& render, const RaymapConfig& raymap, int threads) {
  const std::uint64_t free = free_memory();
  const std::optional<RenderCost> cost = interruptible(
      console, [&] { return cost_of(render.calibrations(), raymap, parallel::Workers(threads).threads()); });
  if (!cost) return {};
  NODAL_TRY(check_cost(*cost, raymap, free));
  if (is_worth_saying(*cost, free)) {
    console.note(
        fmt::format("a raymap of {}x{} pixels needs about {} of memory and {:.0f} s to prepare; --width makes it "
                    "smaller",
                    raymap.width, raymap.height, show_bytes(cost->bytes), cost->seconds));
  }
  return {};
}

Status run_render(Context& context, RenderArgs args) {
  watch_interrupts();
  Console& console = context.console();
  const auto begin = std::chrono::steady_clock::now();
  NODAL_TRY_ASSIGN(const media::TakeFolder folder, open_take(context, args.folder));
  NODAL_TRY_ASSIGN(const RaymapConfig raymap, wanted_raymap(folder, args));
  render::RenderOptions options;
  options.raymap = raymap;
  options.threads = args.threads;
  if (!args.calibration.empty()) {
    NODAL_TRY_ASSIGN(options.calibration, read_calibration(args.calibration, console));
  }
  if (!args.from.empty()) options.from = *parse_duration(args.from);
  if (!args.to.empty()) options.to = *parse_duration(args.to);
  if (options.to <= options.from) {
    return fail(Errc::kBadValue, fmt::format("--from {} --to {}: the end must be behind the beginning",
                                             args.from.empty() ? "0s" : args.from, args.to));
  }
  const auto render = render::TakeRender::make(folder, options);
  if (!render) return fail(render.error());
  if (const Status fits = check_memory(console, **render, raymap, args.threads); !fits) {
    return fail(fits.error().in(args.folder));
  }

  if (is_coded_film(args.out, args.film.given())) return render_film(console, folder, options, args.out, args.film);
  if (args.film.given()) {
    return fail(Errc::kBadValue,
                fmt::format("--out {}: --codec, --crf, --preset, --preview, --plan, --segments and --join are for "
                            "films: let it end in .mp4, .mov or .mkv",
                            args.out));
  }

  const bool many = folder.manifest().sets * static_cast<std::uint64_t>(raymap.raymaps_a_set()) > 1;
  if (args.out.empty()) args.out = many ? "raymaps.mkv" : "raymap.jpg";
  Result<RaymapSink> sink = make_sink(args.out);
  if (!sink) return fail(sink.error());
  if (many && !is_film(args.out) && !has_number(args.out)) {
    return fail(Errc::kBadValue, fmt::format("--out {}: the take has {}, and every raymap needs a name of its own; put "
                                             "%06d into it, or make a film (.mkv)",
                                             args.out, counted(folder.manifest().sets, "set")));
  }
  RaymapMaker maker(raymap, sink->format == media::RaymapFormat::kJpg);
  Rendered done;
  {
    const double period = static_cast<double>(folder.about().rate.period().ns());
    const auto recorded = static_cast<double>(folder.manifest().sets + folder.manifest().deleted_sets);
    const auto sets_before = [&](Duration time) {
      return static_cast<std::uint64_t>(std::ceil(std::min(static_cast<double>(time.ns()) / period, recorded)));
    };
    const std::uint64_t first = sets_before(options.from);
    Progress bar(console, "rendering", std::max<std::uint64_t>(1, sets_before(options.to) - first));
    const auto compiled = [&](double part) {
      bar.update(done.raymaps, fmt::format("compiling the blend table, {:.0f} %", 100 * part));
    };
    render::RenderedRaymap rendered;
    for (;;) {
      const auto next = [&] { return (*render)->next(rendered, compiled); };
      NODAL_TRY_ASSIGN(const bool more, done.raymaps == 0 ? interruptible(console, next) : next());
      if (!more || interrupted()) break;
      const media::TakeSet& set = (*render)->set();
      NODAL_TRY_ASSIGN(const media::Raymap made,
                       maker.make(rendered, set, (*render)->calibration(), (*render)->rate()));
      if (is_film(args.out) && !sink->film) sink = RaymapSink::film_of(args.out);
      if (!sink) return fail(sink.error());
      if (sink->film && done.raymaps == 0) sink->film->film().set_utc_offset(folder.about().utc_offset_ns());
      NODAL_TRY_ASSIGN(const std::string stored, sink->store(made, ++done.raymaps, console));
      done.last = stored;
      if (rendered.field.value_or(0) == 0) done.undecodable += rendered.undecodable_heads;
      if (rendered.heads != (1U << folder.about().heads.size()) - 1) ++done.incomplete;
      Json json = media::to_json(made.meta);
      json["file"] = done.last;
      json["index"] = set.evidence.index();
      console.document({{"raymap", json}});
      bar.update(set.evidence.index() + 1 - std::min(first, set.evidence.index()), done.last);
    }
  }
  if (sink->film) {
    NODAL_TRY(sink->film->film().end());
  }
  if (interrupted()) {
    return fail(Errc::kCancelled, fmt::format("stopped after {}; the newest is in {}", counted(done.raymaps, "raymap"),
                                              done.last.empty() ? args.out : done.last));
  }
  if (done.raymaps == 0) {
    const take::Manifest& manifest = folder.manifest();
    std::string deleted;
    if (manifest.deleted_sets != 0) {
      deleted = fmt::format(" without the {} that the rig deleted to make room", counted(manifest.deleted_sets, "set"));
    }
    return fail(Errc::kNotFound, fmt::format("{}: no set between --from and --to; the take is {} long{}", args.folder,
                                             show_duration(static_cast<std::uint64_t>(manifest.length.ns())), deleted));
  }
  const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  console.document({{"summary",
                     {{"raymaps", done.raymaps},
                      {"incomplete", done.incomplete},
                      {"undecodable_pictures", done.undecodable},
                      {"calibration", to_hex((*render)->calibration())},
                      {"layout", raymap.layout},
                      {"width", raymap.width},
                      {"height", raymap.height},
                      {"out", args.out},
                      {"seconds", seconds}}}});
  tell_losses(console, **render, done);
  console.line(fmt::format("{}: {} of {}x{}, {} ({:.1f} s)", args.out, counted(done.raymaps, "raymap"), raymap.width,
                           raymap.height, raymap.layout, seconds));
  return {};
}

}  // namespace

void add_render(CLI::App& app, CommandLine& line) {
  CLI::App* command = add_command(
      app, "render", "Blend a take's pictures to raymaps",
      "  nodal render 000042                                  raymaps.mkv, a film\n"
      "  nodal render 000042 -o sphere.mp4                    a film for players, headsets and YouTube\n"
      "  nodal render 000042 -o r-%06d.png --from 10s --to 12s\n"
      "  nodal render 42 -o still.jpg                         a still on the rig's disk\n"
      "  nodal render 000042 -o cube.mkv --layout cube --calibration better.json\n"
      "The rig's own calibrations and [raymap] are in the take. With them, and if the take has the pictures as the\n"
      "heads delivered them, the pixels are those of the rig's raymaps; sets that the rig had no time to blend are\n"
      "rendered, too.\n");
  auto args = std::make_shared<RenderArgs>();
  command->add_option("TAKE", args->folder, kTakeArgumentHelp)->required()->type_name("");
  command
      ->add_option(
          "-o,--out", args->out,
          "A film of JPEGs, .mkv (raymaps.mkv when not given); a film for players, .mp4, .mov or, with --codec,\n"
          ".mkv; or files, .jpg, .png, .tif or .raw, with %06d")
      ->type_name("FILE");
  command->add_option("--calibration", args->calibration, "Another calibration than the take's, for the same heads")
      ->type_name("FILE");
  add_layout_option(*command, args->layout, "Layout of the result (the rig's when not given)");
  command->add_option("--width", args->width, "As fine as the rig's raymaps when not given")
      ->type_name("PX")
      ->check(CLI::Range(16, geometry::kMaxRaymapSide));
  command->add_option("--from", args->from, "Begin at this time of the take, such as 10s")
      ->type_name("DURATION")
      ->check(checked_by(parse_duration));
  command->add_option("--to", args->to, "End at this time of the take")
      ->type_name("DURATION")
      ->check(checked_by(parse_duration));
  command->add_option("--quality", args->quality, "Quality of JPEGs; the rig's when not given")
      ->type_name("N")
      ->check(CLI::Range(1, 100));
  command
      ->add_option("--threads", args->threads,
                   "Number of threads (one for each core when not given); the result is the same")
      ->type_name("N")
      ->check(CLI::Range(1, 256));
  add_coding_options(*command, args->film.coding);
  add_parts_options(*command, args->film.parts);
  line.on(command, [args](Context& context) { return run_render(context, *args); });
}

}  // namespace nodal::host
