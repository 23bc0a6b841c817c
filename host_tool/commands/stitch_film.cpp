#include "host_tool/commands/stitch_film.h"

#include <fmt/format.h>
#include <sys/resource.h>

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <optional>

#include "host_tool/commands/film_calibration.h"
#include "host_tool/commands/film_request.h"
#include "host_tool/console/files.h"
#include "host_tool/console/interrupt.h"
#include "host_tool/console/overwriting.h"
#include "host_tool/console/quantities.h"
#include "host_tool/film/film_join.h"
#include "host_tool/film/head_clocks.h"
#include "host_tool/film/segments.h"
#include "host_tool/input/calibration_file.h"
#include "host_tool/input/own_pictures.h"
#include "protocol/base/sha256.h"
#include "protocol/base/try.h"

namespace nodal::host {
namespace {

/// Processor seconds of this process and of the ffmpegs that have ended.
double processor_seconds() {
  double sum = 0;
  for (const int who : {RUSAGE_SELF, RUSAGE_CHILDREN}) {
    rusage usage{};
    ::getrusage(who, &usage);
    for (const timeval& part : {usage.ru_utime, usage.ru_stime}) {
      sum += static_cast<double>(part.tv_sec) + 1e-6 * static_cast<double>(part.tv_usec);
    }
  }
  return sum;
}

/// Everything of one run.
class FilmRun {
 public:
  FilmRun(Context& context, const StitchArgs& args, const FilmArgs& words)
      : console_(context.console()), args_(args), words_(words), parts_(film::parts_of(args.out)) {}

  Status run() {
    NODAL_TRY_ASSIGN(programs_, film::find_programs());
    if (films_alone(args_)) NODAL_TRY(find_calibration());
    NODAL_TRY_ASSIGN(const auto request, make_request(console_, args_, words_, found_, notes_));
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

  /// The calibration of films alone: the one that a run before has left in the folder of parts, or found in frames.
  Status find_calibration() {
    film::FilmRequest request;  // what is known before
    request.films = args_.inputs;
    request.one_file = args_.inputs.size() == 1;
    NODAL_TRY_ASSIGN(const auto words, film::words_of(request, programs_));
    const std::string identity = words["films"].dump() + args_.split;
    const std::string of_films =
        to_hex(sha256({reinterpret_cast<const std::uint8_t*>(identity.data()), identity.size()})).substr(0, 16);
    const std::string stored = fmt::format("{}/rig-{}.json", parts_.path, of_films);
    std::error_code error;
    if (std::filesystem::exists(stored, error)) {
      NODAL_TRY_ASSIGN(found_, read_calibration(stored, console_));
      return {};
    }
    if (words_.join) return no_plan();
    PictureSplit split;
    std::vector<std::string> names = head_names(request.films);
    if (request.one_file) {
      NODAL_TRY_ASSIGN(const film::FilmFile whole, film::probe(programs_, args_.inputs.front()));
      if (whole.tracks == 1) {
        NODAL_TRY_ASSIGN(split, split_of_film(programs_, whole, args_.split, parts_.path));
        names = part_names(split);
      }
      request.films.resize(std::max(static_cast<std::size_t>(whole.tracks), split.count()), whole.path);
      if (whole.tracks > 1) names = head_names(request.films);
    }
    NODAL_TRY_ASSIGN(const auto films, probe_films(programs_, request, split));
    for (std::size_t h = 0; h < names.size(); ++h) {
      HeadCalibration head;
      head.name = names[h];
      head.width = films[h].width;
      head.height = films[h].height;
      request.calibration.heads.push_back(std::move(head));
    }
    request.times_by = words_.times;
    NODAL_TRY_ASSIGN(request.times, given_times(words_));
    auto timed = with_times(request, films, Lenses::kUnknown);
    if (!timed && timed.error().code != Errc::kNotDetermined) return fail(timed.error());
    if (timed && words_.times == "auto") heard_ = timed->times;
    else notes_.clear();  // it is found again, by what the user named or with known lenses
    std::vector<film::HeadTime> times;
    for (const std::string& name : names) {
      const auto& those = timed ? timed->times : request.times;
      const auto known = std::ranges::find(those, name, &film::HeadTime::head);
      times.push_back(known != those.end() ? *known : film::HeadTime{name});
    }
    NODAL_TRY_ASSIGN(const StitchedPictures still,
                     calibrate_films(console_, args_, programs_, films, names, times, timed.has_value(), parts_.path));
    found_ = still.calibration;
    still_ = still.document;
    for (const std::string& line : still.lines) console_.line(line);
    return write_file(stored, to_json(*found_));
  }

  tl::unexpected<Error> no_plan() const {
    return fail(Errc::kNotFound, fmt::format("{}: there is no plan; make the segments first", parts_.path));
  }

  Status get_plan(const film::FilmRequest& request) {
    NODAL_TRY_ASSIGN(const auto words, film::words_of(request, programs_));
    NODAL_TRY_ASSIGN(auto stored, film::stored_plan(parts_, words));
    if (stored) {
      plan_ = std::move(*stored);
      say_notes();
      return {};
    }
    if (words_.join) return no_plan();
    NODAL_TRY_ASSIGN(const auto films, probe_films(programs_, request));
    NODAL_TRY_ASSIGN(const film::FilmRequest timed, with_times(request, films, Lenses::kKnown));
    NODAL_TRY_ASSIGN(plan_, film::make_plan(timed, films, programs_, notes_));
    plan_.times_residual_s = residual_s_;
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

  enum class Lenses { kUnknown, kKnown };
  /// The request with every head's time. How fast pictures turn tells it only where lenses are known.
  Result<film::FilmRequest> with_times(const film::FilmRequest& request, const std::vector<film::FilmFile>& films,
                                       Lenses lenses) {
    film::FilmRequest timed = request;
    // Parts of one picture are of one instant.
    if (request.times_by == "begin" || films.front().place) return timed;
    if (heard_) {
      timed.times = *heard_;
      return timed;
    }
    film::ClockSources sources;
    if (request.times_by != "auto") sources = *film::parse_clock_sources(request.times_by);
    sources.readout_s = request.readout_s;
    if (lenses == Lenses::kUnknown) sources.rotation = sources.flash = false;
    const std::string folder = std::filesystem::absolute(args_.out).parent_path().string();
    std::string doing;
    std::optional<Progress> bar;
    auto clocks = film::find_clocks(programs_, films, request.calibration, request.times, sources, folder, notes_,
                                    [&](const std::string& what, double part) {
                                      if (what != doing) bar.emplace(console_, what, 100);
                                      doing = what;
                                      bar->update(static_cast<std::uint64_t>(100 * part), "");
                                      return !interrupted();
                                    });
    if (!clocks && clocks.error().code == Errc::kNotDetermined) {
      return fail(Errc::kNotDetermined,
                  fmt::format("{}; or --times begin, if one signal started all cameras", clocks.error().message));
    }
    if (!clocks) return fail(clocks.error());
    timed.times = std::move(clocks->times);
    residual_s_ = clocks->residual_s;
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
    const auto needed = [&](std::uint64_t segment) { return !parts_.has(plan_, segment); };
    for (std::uint64_t segment = range.first; segment <= range.last && !blend_; ++segment) {
      if (needed(segment)) NODAL_TRY(make_blend());
    }
    const auto begun = std::chrono::steady_clock::now();
    const double processor = processor_seconds();
    std::optional<Progress> bar;
    for (std::uint64_t segment = range.first; segment <= range.last; ++segment) {
      if (!needed(segment)) {
        kept += plan_.end_of(segment) - plan_.begin_of(segment);
        continue;
      }
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
    processor_seconds_ = processor_seconds() - processor;
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
    std::vector<SegmentRange> missing;
    std::uint64_t count = 0;
    for (std::uint64_t segment = 0; segment < plan_.segments(); ++segment) {
      if (parts_.has(plan_, segment)) continue;
      if (missing.empty() || missing.back().last + 1 != segment) missing.push_back({segment, segment});
      missing.back().last = segment;
      ++count;
    }
    Json ranges = Json::array();
    for (const SegmentRange& range : missing) ranges.push_back({range.first, range.last});
    console_.document(
        {{"plan", parts_.plan_file()}, {"frames", plan_.frames}, {"segments", plan_.segments()}, {"missing", ranges}});
    console_.line(fmt::format("{}: {} in {}, 0 to {}; {}", parts_.plan_file(), counted(plan_.frames, "frame"),
                              counted(plan_.segments(), "segment"), plan_.segments() - 1,
                              count == 0 ? "all are there" : fmt::format("{} missing", count)));
    return {};
  }

  void say_result() {
    const double hertz = 1.0 * plan_.coding.rate.numerator / plan_.coding.rate.denominator;
    const double blending = blend_ ? blend_->seconds() : 0;
    Json heads = Json::array();
    for (const film::PlannedHead& head : plan_.heads) {
      const film::HeadTime& clock = head.clock;
      heads.push_back({{"head", head.name},
                       {"film", head.film.path},
                       {"offset_s", clock.offset_s},
                       {"ppm", clock.ppm},
                       {"sigma_ms", 1000 * clock.sigma_s},
                       {"ppm_sigma", clock.ppm_sigma},
                       {"by", clock.by.empty() ? "begin" : clock.by},
                       {"farthest_ms", 1000 * head.farthest_s}});
    }
    Json document = {{"out", args_.out},
                     {"frames", plan_.frames},
                     {"rate", hertz},
                     {"layout", plan_.raymap.layout},
                     {"width", plan_.raymap.width},
                     {"height", plan_.raymap.height},
                     {"codec", film::name_of(plan_.coding.codec)},
                     {"sound", plan_.sound ? Json(plan_.sound->path) : Json(nullptr)},
                     {"heads", heads},
                     {"times_residual_ms", 1000 * plan_.times_residual_s},
                     {"rendered_frames", done_},
                     {"seconds", seconds_},
                     {"processor_seconds", processor_seconds_},
                     {"blend_seconds", blending}};
    if (!still_.is_null()) document["still"] = still_;
    console_.document(document);
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
  std::optional<Calibration> found_;                  // calibration that the films' frames gave
  std::optional<std::vector<film::HeadTime>> heard_;  // the heads' times, if they are known before their lenses
  Json still_;                                        // what `nodal stitch` says of these frames
  std::vector<std::string> notes_;
  std::uint64_t done_ = 0;
  double seconds_ = 0, processor_seconds_ = 0, residual_s_ = 0;
};

}  // namespace

bool makes_film(const std::string& out) { return film::container_of(out).has_value(); }

Status run_film(Context& context, const StitchArgs& args, const FilmArgs& film) {
  watch_interrupts();
  return FilmRun(context, args, film).run();
}

}  // namespace nodal::host
