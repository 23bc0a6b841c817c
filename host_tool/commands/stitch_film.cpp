#include "host_tool/commands/stitch_film.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <optional>

#include "host_tool/console/interrupt.h"
#include "host_tool/console/overwriting.h"
#include "host_tool/console/quantities.h"
#include "host_tool/film/film_join.h"
#include "host_tool/film/segments.h"
#include "host_tool/film/sound_times.h"
#include "host_tool/input/calibration_file.h"
#include "host_tool/output/layout_name.h"
#include "protocol/base/try.h"
#include "stitch/offline/offline_blend.h"

namespace nodal::host {
namespace {

namespace fs = std::filesystem;

constexpr int kWidestUsual = 4096;  // px: what players decode as H.264

struct SegmentRange {
  std::uint64_t first = 0, last = 0;
};

/// "3", or "0-9". Errors: kBadValue.
Result<SegmentRange> parse_segments(const std::string& text) {
  SegmentRange range;
  const char* const end = text.data() + text.size();
  auto [at, error] = std::from_chars(text.data(), end, range.first);
  range.last = range.first;
  if (error == std::errc() && at != end && *at == '-') {
    const auto [after, wrong] = std::from_chars(at + 1, end, range.last);
    at = after;
    error = wrong;
  }
  if (error == std::errc() && at == end && range.first <= range.last) return range;
  return fail(Errc::kBadValue,
              fmt::format("'{}': write a segment's number, or the first and the last one, such as 0-9", text));
}

tl::unexpected<Error> not_for_films(const std::string& option, const std::string& why) {
  return fail(Errc::kUnsupported, fmt::format("{}: {}; leave it out", option, why));
}

/// The films in the order of the heads: by their names if these are the heads' names, else as they are given.
Result<std::vector<std::string>> films_of(const Calibration& calibration, const std::vector<std::string>& inputs,
                                          std::vector<std::string>& notes) {
  const std::vector<std::string> films(inputs.begin() + 1, inputs.end());
  if (films.size() != calibration.heads.size()) {
    return fail(Errc::kHeadMismatch,
                fmt::format("{}: the calibration has {}, and there are {}; give one film for each "
                            "head, in its order",
                            inputs.front(), counted(calibration.heads.size(), "head"), counted(films.size(), "film")));
  }
  std::vector<std::string> ordered;
  for (const HeadCalibration& head : calibration.heads) {
    const auto film =
        std::ranges::find_if(films, [&](const std::string& path) { return fs::path(path).stem() == head.name; });
    if (film != films.end()) ordered.push_back(*film);
  }
  if (ordered.size() != films.size()) return films;
  if (ordered != films) notes.emplace_back("the films have the heads' names, and are taken by these");
  return ordered;
}

Result<film::FilmRequest> make_request(Console& console, const StitchArgs& args, const FilmArgs& words,
                                       std::vector<std::string>& notes) {
  if (!args.nominal.rig.empty() || film::is_film_name(args.inputs.front())) {
    return fail(Errc::kMissingField,
                "a film needs a calibration in front of the films. Find one in pictures of the same "
                "instant: nodal stitch PICTURE... -o s.jpg writes s.rig.json");
  }
  if (args.bits == 16) return not_for_films("--bits 16", "films have 8 bits");
  if (args.crop != "auto" && args.crop != "none") return not_for_films("--crop", "a film has the whole sphere");
  if (args.up != "auto") return not_for_films("--up", "a film's sphere stands as the calibration says");
  film::FilmRequest request;
  NODAL_TRY_ASSIGN(request.calibration, read_calibration(args.inputs.front(), console));
  if (args.distance > 0) {
    request.calibration.distance = args.distance;
    if (const Status good = check_calibration(request.calibration); !good) return fail(good.error().in("--distance"));
  }
  NODAL_TRY_ASSIGN(const auto films, films_of(request.calibration, args.inputs, notes));
  for (const std::string& path : films) request.films.push_back(fs::absolute(path).string());
  for (const std::string& text : words.offsets) {
    NODAL_TRY_ASSIGN(film::HeadTime time, film::parse_head_time(text));
    request.times.push_back(std::move(time));
  }
  request.times_by = words.times;
  const auto is_head = [&](const HeadCalibration& head) { return head.name == words.sound; };
  request.sound = words.sound;
  const bool word = words.sound == "auto" || words.sound == "none";
  if (!word && std::ranges::none_of(request.calibration.heads, is_head)) {
    std::error_code error;
    if (!fs::exists(words.sound, error)) {
      return fail(Errc::kNotFound, fmt::format("--sound {}: there is no head and no file of this name", words.sound));
    }
    request.sound = fs::absolute(words.sound).string();
  }
  const Result<geometry::LayoutName> layout = layout_named(args.layout);
  if (!layout) return fail(layout.error().in("--layout"));
  NODAL_TRY_ASSIGN(const double resolution, offline::resolution_of(request.calibration));
  const double natural = layout->width_for_resolution(resolution);
  const geometry::RaymapSize size =
      layout->size_for_width(args.width > 0 ? args.width : std::min<double>(natural, kWidestUsual));
  request.raymap.layout = layout->text();
  request.raymap.width = size.width;
  request.raymap.height = size.height;
  request.raymap.seam_width_deg = args.seam_width_deg;
  request.raymap.feather = args.feather;
  if (args.transition == "seam") request.raymap.transition = Transition::kSeam;
  if (args.transition == "feather") request.raymap.transition = Transition::kFeather;
  const bool placed = words.seams == "placed" && args.transition != "feather";
  request.raymap.seams = placed ? SeamPlacement::kPlaced : SeamPlacement::kFixed;
  if (!words.codec.empty()) request.codec = film::codec_named(words.codec);
  request.quality = words.quality;
  request.preset = words.preset;
  request.container = film::container_of(args.out).value_or(film::Container::kMp4);
  if (!layout->is_equirectangular()) {
    notes.push_back(fmt::format("viewers are not told of the layout {}: only equirectangular films say what they are",
                                request.raymap.layout));
  }
  return request;
}

/// Everything of one run.
class FilmRun {
 public:
  FilmRun(Context& context, const StitchArgs& args, const FilmArgs& words)
      : console_(context.console()), args_(args), words_(words), parts_(film::parts_of(args.out)) {}

  Status run() {
    NODAL_TRY_ASSIGN(programs_, film::find_programs());
    NODAL_TRY_ASSIGN(const auto request, make_request(console_, args_, words_, notes_));
    NODAL_TRY(get_plan(request));
    if (words_.plan) return say_plan();
    if (!words_.join) NODAL_TRY(render());
    if (!words_.segments.empty()) return {};
    NODAL_TRY(film::join(plan_, parts_, args_.out, programs_));
    film::remove_parts(parts_);
    say_result();
    return {};
  }

 private:
  void say_notes() {
    for (const std::string& note : notes_) console_.note("note: " + note);
    notes_.clear();
  }

  Status get_plan(const film::FilmRequest& request) {
    NODAL_TRY_ASSIGN(const auto words, film::words_of(request, programs_));
    NODAL_TRY_ASSIGN(auto stored, film::stored_plan(parts_, words));
    if (stored) {
      plan_ = std::move(*stored);
      say_notes();
      return {};
    }
    if (words_.join) {
      return fail(Errc::kNotFound, fmt::format("{}: there is no plan; make the segments first", parts_.path));
    }
    std::vector<film::FilmFile> films;
    for (const std::string& path : request.films) {
      NODAL_TRY_ASSIGN(film::FilmFile film, film::probe(programs_, path));
      films.push_back(std::move(film));
    }
    for (std::size_t h = 0; h < films.size(); ++h) {
      const HeadCalibration& head = request.calibration.heads[h];
      if (films[h].width == head.width && films[h].height == head.height) continue;
      return fail(Errc::kHeadMismatch,
                  fmt::format("{}: its pictures have {}x{} pixels, and head '{}' is calibrated for "
                              "{}x{}{}",
                              films[h].path, films[h].width, films[h].height, head.name, head.width, head.height,
                              films[h].rotation_deg != 0 ? ", as they are coded, before they are "
                                                           "rotated as the file says"
                                                         : ""));
    }
    NODAL_TRY_ASSIGN(const film::FilmRequest timed, with_times(request, films));
    NODAL_TRY_ASSIGN(plan_, film::make_plan(timed, films, programs_, notes_));
    plan_.request = words;  // what was asked for, by which this plan is found again
    say_notes();
    if (plan_.raymap.seams == SeamPlacement::kPlaced) {
      NODAL_TRY(make_blend());
      Progress bar(console_, "placing seams", plan_.segments());
      NODAL_TRY(as_stopped(film::plan_seams(plan_, *blend_, programs_, [&](std::uint64_t segment) {
        bar.update(segment, "");
        return !interrupted();
      })));
    }
    NODAL_TRY_ASSIGN(plan_, film::store_plan(parts_, plan_));
    return {};
  }

  /// The request with every head's time.
  Result<film::FilmRequest> with_times(const film::FilmRequest& request, const std::vector<film::FilmFile>& films) {
    film::FilmRequest timed = request;
    std::vector<std::string> heads;
    for (const HeadCalibration& head : request.calibration.heads) heads.push_back(head.name);
    const bool heard = film::have_sound(films, heads, request.times);
    if (request.times_by == "begin" || (request.times_by == "auto" && !heard)) {
      if (request.times.empty() && request.times_by == "auto") {
        notes_.emplace_back(
            "not all films have sound, so they are taken to begin at the same instant; --offset HEAD=SECONDS says "
            "otherwise");
      }
      return timed;
    }
    if (!heard) {
      return fail(Errc::kBadValue,
                  "--times sound: the first head and all others without --offset need sound; give --offset "
                  "HEAD=SECONDS for those without it");
    }
    Progress bar(console_, "comparing the films' sound", 100);
    auto times = film::times_by_sound(programs_, films, heads, request.times, notes_, [&](double part) {
      bar.update(static_cast<std::uint64_t>(100 * part), "");
      return !interrupted();
    });
    if (!times) return fail(times.error().in("the films' times, from their sound"));
    timed.times = std::move(*times);
    return timed;
  }

  Status make_blend() {
    if (blend_) return {};
    Progress bar(console_, "compiling the blend table", 100);
    auto made = interruptible(console_, [&] {
      return film::FilmBlend::make(plan_, args_.threads,
                                   [&](double part) { bar.update(static_cast<std::uint64_t>(100 * part), ""); });
    });
    if (!made) return fail(made.error().in(args_.inputs.front()));
    blend_.emplace(std::move(*made));
    return {};
  }

  /// The same status; after Ctrl-C with what is left and how to go on.
  Status as_stopped(Status status) {
    if (status || status.error().code != Errc::kCancelled) return status;
    return fail(Errc::kCancelled,
                fmt::format("stopped; {} has the segments that are whole, and the same command goes on "
                            "from there",
                            parts_.path));
  }

  Status render() {
    SegmentRange range{0, plan_.segments() - 1};
    if (!words_.segments.empty()) range = *parse_segments(words_.segments);
    if (range.last >= plan_.segments()) {
      return fail(Errc::kBadValue, fmt::format("--segments {}: the film has the segments 0 to {}", words_.segments,
                                               plan_.segments() - 1));
    }
    const std::uint64_t begin = plan_.begin_of(range.first), end = plan_.end_of(range.last);
    std::uint64_t kept = 0;
    const auto begun = std::chrono::steady_clock::now();
    std::optional<Progress> bar;
    for (std::uint64_t segment = range.first; segment <= range.last; ++segment) {
      if (parts_.has(plan_, segment)) {
        kept += plan_.end_of(segment) - plan_.begin_of(segment);
        continue;
      }
      NODAL_TRY(make_blend());
      if (!bar) bar.emplace(console_, "stitching", end - begin);
      const std::uint64_t before = plan_.begin_of(segment) - begin;
      auto rendered = film::render_segment(plan_, segment, parts_, *blend_, programs_, [&](std::uint64_t frame) {
        const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begun).count();
        bar->update(before + frame, fmt::format("{:.1f} frames/s", static_cast<double>(done_ + frame) / seconds));
        return !interrupted();
      });
      if (!rendered) return as_stopped(fail(rendered.error()));
      done_ += plan_.end_of(segment) - plan_.begin_of(segment);
      notes_.insert(notes_.end(), rendered->notes.begin(), rendered->notes.end());
    }
    seconds_ = std::chrono::duration<double>(std::chrono::steady_clock::now() - begun).count();
    bar.reset();
    console_.finish_progress();
    say_notes();
    if (kept > 0) console_.note(fmt::format("{} were there already", counted(kept, "frame")));
    if (words_.segments.empty()) return {};
    console_.document({{"segments", {range.first, range.last}}, {"frames", done_}, {"folder", parts_.path}});
    console_.line(fmt::format("{}: segments {} to {} of {} ({:.1f} s)", parts_.path, range.first, range.last,
                              plan_.segments(), seconds_));
    return {};
  }

  Status say_plan() {
    console_.document({{"plan", parts_.plan_file()}, {"frames", plan_.frames}, {"segments", plan_.segments()}});
    console_.line(fmt::format("{}: {} in {}, 0 to {}", parts_.plan_file(), counted(plan_.frames, "frame"),
                              counted(plan_.segments(), "segment"), plan_.segments() - 1));
    return {};
  }

  void say_result() {
    const double hertz = 1.0 * plan_.coding.rate.numerator / plan_.coding.rate.denominator;
    const double blending = blend_ ? blend_->seconds() : 0;
    Json heads = Json::array();
    for (const film::PlannedHead& head : plan_.heads) {
      heads.push_back({{"head", head.name}, {"film", head.film.path}, {"farthest_ms", 1000 * head.farthest_s}});
    }
    console_.document({{"out", args_.out},
                       {"frames", plan_.frames},
                       {"rate", hertz},
                       {"layout", plan_.raymap.layout},
                       {"width", plan_.raymap.width},
                       {"height", plan_.raymap.height},
                       {"codec", film::name_of(plan_.coding.codec)},
                       {"sound", plan_.sound ? Json(plan_.sound->path) : Json(nullptr)},
                       {"heads", heads},
                       {"rendered_frames", done_},
                       {"seconds", seconds_},
                       {"blend_seconds", blending}});
    console_.line(fmt::format("{}: {} of {}x{}, {:.2f} a second, {}, {}, from {} ({:.1f} s)", args_.out,
                              counted(plan_.frames, "frame"), plan_.raymap.width, plan_.raymap.height, hertz,
                              film::name_of(plan_.coding.codec), plan_.sound ? "with sound" : "without sound",
                              counted(plan_.heads.size(), "head"), seconds_));
  }

  Console& console_;
  const StitchArgs& args_;
  const FilmArgs& words_;
  film::PartsFolder parts_;
  film::Programs programs_;
  film::FilmPlan plan_;
  std::optional<film::FilmBlend> blend_;
  std::vector<std::string> notes_;
  std::uint64_t done_ = 0;
  double seconds_ = 0;
};

}  // namespace

void add_film_options(CLI::App& command, FilmArgs& args) {
  command
      .add_option("--codec", args.codec,
                  "Of a film: h264 (up to 4096 px wide when not given), h265, prores, ffv1 (lossless), or mpeg2, 15\n"
                  "Mbit/s")
      ->type_name("h264|h265|prores|ffv1|mpeg2")
      ->check(CLI::IsMember({"h264", "h265", "prores", "ffv1", "mpeg2"}));
  command.add_option("--crf", args.quality, "Of a film in h264 and h265: 0 (best) to 51 (20 and 23 when not given)")
      ->type_name("N")
      ->check(CLI::Range(0, 51));
  const std::vector<std::string> presets{"ultrafast", "superfast", "veryfast", "faster",  "fast",
                                         "medium",    "slow",      "slower",   "veryslow"};
  command
      .add_option("--preset", args.preset, "Of a film in h264 and h265: how long they search (medium when not given)")
      ->type_name("ultrafast|superfast|veryfast|faster|fast|medium|slow|slower|veryslow")
      ->check(CLI::IsMember(presets));
  command
      .add_option(
          "--offset", args.offsets,
          "Of a film: what the first head shows at a time, this head shows SECONDS later in its own film; PPM:\n"
          "how much faster its clock runs, in millionths. Once for each head that has one")
      ->type_name("HEAD=SECONDS[,PPM]")
      ->allow_extra_args(false)
      ->check(checked_by(film::parse_head_time));
  command
      .add_option("--times", args.times,
                  "Of a film: sound, each head's time is found in the sound of its film; begin, all films begin at\n"
                  "the same instant (sound if all heads have it, when not given)")
      ->type_name("sound|begin")
      ->check(CLI::IsMember({"sound", "begin"}));
  command
      .add_option("--sound", args.sound,
                  "Of a film: a head, a file, or none (the first head that has sound when not given)")
      ->type_name("HEAD|FILE|none");
  command
      .add_option("--seams", args.seams,
                  "Of a film: placed (when not given), where the pictures agree, once in 240 frames; or fixed")
      ->type_name("placed|fixed")
      ->check(CLI::IsMember({"placed", "fixed"}));
  CLI::Option* const plan = command.add_flag(
      "--plan", args.plan, "Make the plan of a film only, in the folder OUT.parts; for several computers");
  CLI::Option* const segments = command
                                    .add_option("--segments", args.segments,
                                                "Make these parts of a film only, of 240 frames each, in that folder")
                                    ->type_name("A-B")
                                    ->check(checked_by(parse_segments));
  CLI::Option* const join = command.add_flag("--join", args.join, "Join the parts of a film that are there");
  segments->excludes(plan);
  join->excludes(plan)->excludes(segments);
}

bool makes_film(const std::string& out) { return film::container_of(out).has_value(); }

Status run_film(Context& context, const StitchArgs& args, const FilmArgs& film) {
  watch_interrupts();
  return FilmRun(context, args, film).run();
}

}  // namespace nodal::host
