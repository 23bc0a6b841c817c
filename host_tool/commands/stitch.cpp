#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <functional>
#include <optional>
#include <span>

#include "host_tool/commands/command.h"
#include "host_tool/commands/command_list.h"
#include "host_tool/commands/layout_option.h"
#include "host_tool/commands/lens_json.h"
#include "host_tool/commands/nominal_options.h"
#include "host_tool/commands/picture_places_option.h"
#include "host_tool/commands/sphere_options.h"
#include "host_tool/commands/stitch_film.h"
#include "host_tool/commands/stitch_job.h"
#include "host_tool/console/files.h"
#include "host_tool/console/interrupt.h"
#include "host_tool/report/stitch_report.h"
#include "host_tool/report/verdict.h"
#include "protocol/base/try.h"
#include "stitch/geometry/raymap/layout.h"
#include "stitch/media/raymap/raymap_file.h"
#include "stitch/offline/best_blend.h"
#include "stitch/offline/offline_blend.h"
#include "stitch/offline/seam_check.h"

namespace nodal::host {
namespace {

/// The value of --quality that chose the blend before there was --blend.
constexpr const char* kBestAsQuality = "best";
/// The older word for --blend board.
constexpr const char* kBoardAsRig = "rig";

int jpeg_quality(const StitchArgs& args) {
  constexpr int kUsual = 92, kBest = 95;
  if (!args.quality.empty()) return std::stoi(args.quality);
  return best(args) ? kBest : kUsual;
}

table::TableOptions table_options(const StitchArgs& args) {
  table::TableOptions options;
  if (args.transition == "seam") options.transition = Transition::kSeam;
  if (args.transition == "feather") options.transition = Transition::kFeather;
  options.seam_width_deg = args.seam_width_deg;
  options.feather = args.feather;
  options.cover = false;  // every head is there, at the exposure that it was calibrated at
  return options;
}

/// Unlike CLI::Range it refuses NaN.
CLI::Validator number_between(double least, double most) {
  return checked_by([least, most](const std::string& text) -> Result<double> {
    double value = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    if (error == std::errc() && end == text.data() + text.size() && value >= least && value <= most) return value;
    return fail(Errc::kBadValue, fmt::format("'{}': it must be a number from {:g} to {:g}", text, least, most));
  });
}

PixelFormat raymap_format(PixelFormat pictures, int bits) {
  if (bits == 8) return pictures;
  return pictures == PixelFormat::kGrey8 ? PixelFormat::kGrey16 : PixelFormat::kRgb48;
}

/// `raymap`: the part of it that is written. `of`: one of the pictures, for place and time.
Result<std::vector<std::uint8_t>> encode(const StitchJob& job, const DecodedImage& raymap, const DecodedImage& of) {
  media::RaymapFile file;
  file.format = job.format;
  file.quality = jpeg_quality(job.args);
  file.comment = fmt::format("nodal stitch heads={} calibration={}", job.rig.calibration.heads.size(),
                             to_hex(calibration_id(job.rig.calibration)));
  file.layout = job.args.layout;
  file.kept = media::kept_metadata(of.metadata, media::Keep::kPlaceAndTime);
  if (job.part) {
    const RaymapPart& part = *job.part;
    file.area = {job.size.width, job.size.height, part.left, part.top, part.width, part.height};
  }
  return media::encode(raymap, file);
}

bands::Window window_of(const RaymapPart& part) { return {part.left, part.top, part.width, part.height}; }

/// The equirectangular sphere with as many pixels as the raymap.
bands::Grid sphere_of(const StitchJob& job) {
  const int height = std::max(2, static_cast<int>(std::sqrt(std::int64_t{job.size.width} * job.size.height / 2.0)));
  return {2 * height, height};
}

/// Makes the raymaps of a run, one after the other, in the way that the arguments ask for.
class Stitcher {
 public:
  explicit Stitcher(const StitchJob& job) : job_(job) {}

  /// The part of the raymap that is written.
  /// `progress`: 0..1, on the caller's thread. `checks`: the seams of this set, if not null.
  Result<DecodedImage> stitch(std::span<const ImageView> pictures, const std::function<void(double)>& progress,
                              std::vector<offline::SeamCheck>* checks) {
    NODAL_TRY(make(pictures.front().format, progress));
    if (best(job_.args)) {
      NODAL_TRY_ASSIGN(DecodedImage raymap, best_->blend(pictures, checks, progress));
      return job_.part && !job_.part_is_all_seen ? cropped(raymap, *job_.part) : std::move(raymap);
    }
    if (checks != nullptr) {
      NODAL_TRY_ASSIGN(*checks,
                       offline::check_seams(job_.rig.calibration, pictures, sphere_of(job_), job_.args.threads));
    }
    NODAL_TRY_ASSIGN(DecodedImage raymap, board_->blend(pictures));
    return job_.part ? cropped(raymap, *job_.part) : std::move(raymap);
  }

 private:
  Status make(PixelFormat format, const std::function<void(double)>& progress) {
    if (format_ == format) return {};
    const table::RaymapSpec spec{job_.args.layout, job_.size.width, job_.size.height,
                                 raymap_format(format, job_.args.bits)};
    if (best(job_.args)) {
      std::optional<bands::Window> seen;
      if (job_.part_is_all_seen) seen = window_of(*job_.part);
      auto made = offline::BestBlend::make(job_.rig.calibration, spec, job_.args.threads, seen);
      if (!made) return fail(made.error().in(job_.args.inputs.front()));
      best_.emplace(std::move(*made));
    } else {
      auto made = offline::OfflineBlend::make(job_.rig.calibration, spec, table_options(job_.args), format,
                                              job_.args.threads, progress);
      if (!made) return fail(made.error().in(job_.args.inputs.front()));
      board_.emplace(std::move(*made));
    }
    format_ = format;
    return {};
  }

  const StitchJob& job_;
  std::optional<PixelFormat> format_;
  std::optional<offline::OfflineBlend> board_;
  std::optional<offline::BestBlend> best_;
};

/// Linear numbers are made from files that do not call their own numbers linear: the calibration's word alone counts.
void tell_linear(Console& console, const RigPictures& rig, const std::vector<HeadPicture>& set) {
  for (std::size_t h = 0; h < set.size(); ++h) {
    const HeadCalibration& head = rig.calibration.heads[h];
    if (head.response.curve != Response::Curve::kLinear || set[h].file().empty() || set[h].says_linear()) continue;
    console.note(
        fmt::format("note: the calibration says that the numbers of head '{}' are proportional to light, and {} does "
                    "not say it. Ordinary photographs are sRGB: for those, write \"response\": {{\"curve\": "
                    "\"srgb\"}} into the heads of the calibration",
                    head.name, set[h].file()));
    return;
  }
}

/// The page beside a sphere whose calibration was found in its pictures.
Result<std::string> make_report(const StitchJob& job, const DecodedImage& raymap, const Verdict& verdict) {
  NODAL_TRY_ASSIGN(const auto name, geometry::LayoutName::parse(job.args.layout));
  NODAL_TRY_ASSIGN(const auto layout, geometry::make_layout(name, job.size.width, job.size.height));
  std::optional<bands::Window> part;
  if (job.part) part = window_of(*job.part);
  else if (name.is_equirectangular()) part = bands::Window::all({raymap.width, raymap.height});
  HtmlReport page =
      stitch_report({raymap, *layout, part, verdict, job.rig.heads, job.rig.notes, job.rig.match->confidence});
  if (job.details) page.details("How the pictures were registered", *job.details);
  return page.finish();
}

/// The raymaps that are written, and what is to be said of the first one.
struct Stitched {
  std::string last;  ///< name of the last file
  Verdict verdict;
};

Result<Stitched> stitch_sets(Console& console, StitchJob& job, Progress& bar) {
  const StitchArgs& args = job.args;
  const std::size_t count = job.rig.sets.size();
  const std::size_t left_out = job.rig.match ? job.rig.match->given - job.rig.match->placed : 0;
  Stitcher stitcher(job);
  Stitched stitched;
  const std::uint64_t begun = job.rig.match ? kCalibrated : 0;
  // The first raymap takes about twice as long as the others.
  const auto show = [&](double raymaps, std::string_view remark) {
    bar.update(begun + static_cast<std::uint64_t>(static_cast<double>(kStitched - begun) * raymaps /
                                                  static_cast<double>(count + 1)),
               remark);
  };
  double begun_with = 0;
  const auto working = [&](double done) {
    show(begun_with + done, best(args) ? "blending the pictures" : "compiling the blend table");
  };
  for (std::size_t i = 0; i < count; ++i) {
    if (interrupted()) return fail(Errc::kCancelled, fmt::format("stopped after {} of {} spheres", i, count));
    const bool rgb = args.bits == 16 || best(args);
    NODAL_TRY_ASSIGN(auto pictures, interruptible(console, [&] { return take_set(job.rig, i, rgb); }));
    if (i == 0 && args.bits == 16) tell_linear(console, job.rig, job.rig.sets[i]);
    NODAL_TRY_ASSIGN(const std::string name, numbered_name(args.out, i));
    std::string report;
    NODAL_TRY_ASSIGN(auto file, interruptible(console, [&]() -> Result<std::vector<std::uint8_t>> {
                       std::vector<ImageView> views;
                       for (const DecodedImage& picture : pictures) views.push_back(picture.view());
                       std::vector<offline::SeamCheck> checks;
                       NODAL_TRY_ASSIGN(const DecodedImage raymap,
                                        stitcher.stitch(views, working, i == 0 ? &checks : nullptr));
                       if (i == 0) stitched.verdict = verdict_of(std::move(checks), job.rig.heads, left_out);
                       if (i == 0 && job.rig.match) {
                         NODAL_TRY_ASSIGN(report, make_report(job, raymap, stitched.verdict));
                       }
                       return encode(job, raymap, pictures.front());
                     }));
    NODAL_TRY(write_file(name, file));
    // Later than the sphere: a full disk must not leave files that belong to a sphere that is not there.
    if (i == 0 && job.rig.match) NODAL_TRY(write_file(beside(args.out, ".rig.json"), to_json(job.rig.calibration)));
    if (!report.empty()) NODAL_TRY(write_file(beside(args.out, ".report.html"), report));
    stitched.last = name;
    begun_with = static_cast<double>(i + 2);
    show(begun_with, name);
  }
  return stitched;
}

/// What was found in the pictures, for scripts.
void add_match(const StitchJob& job, Json& document) {
  const PointMatch& match = *job.rig.match;
  document["placed"] = match.placed;
  document["given"] = match.given;
  document["points"] = match.point_count;
  document["median_px"] = match.median_px;
  document["confidence"] = match.confidence;
  document["lens"] = lens_json(match.lens);
  document["calibration_file"] = beside(job.args.out, ".rig.json");
  document["report"] = beside(job.args.out, ".report.html");
  document["notes"] = job.rig.notes;
}

Status run_stitch(Context& context, const StitchArgs& args) {
  Console& console = context.console();
  const auto begin = std::chrono::steady_clock::now();
  Progress bar(console, "stitching", kStitched);
  NODAL_TRY_ASSIGN(StitchJob job, interruptible(console, [&] { return make_stitch_job(console, args, bar); }));
  for (const std::string& note : job.rig.notes) console.note("note: " + note);
  const std::size_t count = job.rig.sets.size();
  NODAL_TRY_ASSIGN(const Stitched stitched, stitch_sets(console, job, bar));
  console.finish_progress();
  const RaymapPart made = job.part.value_or(RaymapPart{0, 0, job.size.width, job.size.height});
  const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  Json document{{"raymaps", count},
                {"out", stitched.last},
                {"layout", job.args.layout},
                {"width", made.width},
                {"height", made.height},
                {"share", job.share},
                {"calibration", to_hex(calibration_id(job.rig.calibration))},
                {"verdict", name_of(stitched.verdict.word)},
                {"seams", to_json(stitched.verdict, job.rig.heads)},
                {"seconds", seconds}};
  if (job.rig.match) add_match(job, document);
  if (job.part) {
    document["crop"] = {
        {"left", made.left}, {"top", made.top}, {"full_width", job.size.width}, {"full_height", job.size.height}};
  }
  console.document(document);
  if (job.rig.match) {
    console.line(job.rig.match->confidence);
    console.line(
        fmt::format("calibration: {}, report: {}", beside(args.out, ".rig.json"), beside(args.out, ".report.html")));
  }
  console.line((count == 1 ? "" : "first sphere: ") + stitched.verdict.sentence);
  console.line(fmt::format("{}: {}x{}, {}, from {} heads ({:.1f} s)", count == 1 ? stitched.last : args.out, made.width,
                           made.height, job.args.layout, job.rig.calibration.heads.size(), seconds));
  return {};
}

}  // namespace

void add_stitch(CLI::App& app, CommandLine& line) {
  CLI::App* command = add_command(
      app, "stitch", "Make a picture of the whole sphere from pictures of a rig's heads; needs no rig",
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
