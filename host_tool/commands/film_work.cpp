#include "host_tool/commands/film_work.h"

#include <fmt/format.h>
#include <sys/resource.h>

#include <chrono>
#include <optional>
#include <utility>

#include "host_tool/commands/film_request.h"
#include "host_tool/console/interrupt.h"
#include "host_tool/console/quantities.h"
#include "host_tool/film/film_join.h"
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

/// One run.
class FilmWork {
 public:
  FilmWork(Console& console, const std::string& out, const PartsArgs& args, const film::Programs& programs,
           FilmContent& content, std::vector<std::string>& notes)
      : console_(console),
        out_(out),
        args_(args),
        programs_(programs),
        content_(content),
        parts_(film::parts_of(out)),
        notes_(notes) {}

  Status run() {
    NODAL_TRY(get_plan());
    if (args_.plan) return say_plan();
    if (!args_.join) NODAL_TRY(render());
    if (!args_.segments.empty()) return {};
    NODAL_TRY(film::join(plan_, parts_, out_, programs_));
    film::remove_parts(parts_);
    say_result();
    return {};
  }

 private:
  void say_notes() {
    for (const std::string& note : std::exchange(notes_, {})) console_.note("note: " + note);
  }

  Status get_plan() {
    NODAL_TRY_ASSIGN(const auto words, content_.words());
    NODAL_TRY_ASSIGN(auto stored, film::stored_plan(parts_, words));
    if (stored) {
      plan_ = std::move(*stored);
      say_notes();
      return {};
    }
    if (args_.join) return no_plan(parts_);
    auto planned = content_.plan(notes_);
    if (!planned) return as_stopped(fail(planned.error()));
    plan_ = std::move(*planned);
    plan_.request = words;  // what was asked for, by which this plan is found again
    say_notes();
    if (plan_.raymap.seams == SeamPlacement::kPlaced) {
      NODAL_TRY(make_source());
      Progress bar(console_, "placing seams", plan_.segments());
      NODAL_TRY(as_stopped(film::plan_seams(plan_, *source_, [&](std::uint64_t segment) {
        bar.update(segment, "");
        return !interrupted();
      })));
    }
    NODAL_TRY_ASSIGN(plan_, film::store_plan(parts_, plan_));
    return {};
  }

  Status make_source() {
    if (source_) return {};
    NODAL_TRY_ASSIGN(source_, content_.source(plan_));
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
    if (!args_.segments.empty()) range = *parse_segments(args_.segments);
    if (range.last >= plan_.segments()) {
      return fail(Errc::kBadValue, fmt::format("--segments {}: the film has the segments 0 to {}", args_.segments,
                                               plan_.segments() - 1));
    }
    const std::uint64_t begin = plan_.begin_of(range.first), end = plan_.end_of(range.last);
    std::uint64_t kept = 0;
    const auto needed = [&](std::uint64_t segment) { return !parts_.has(plan_, segment); };
    for (std::uint64_t segment = range.first; segment <= range.last && !source_; ++segment) {
      if (needed(segment)) NODAL_TRY(make_source());
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
      auto rendered = film::render_segment(plan_, segment, parts_, *source_, programs_, [&](std::uint64_t frame) {
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
    if (args_.segments.empty()) return {};
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
    const double blending = source_ ? source_->seconds() : 0;
    Json document = {{"out", out_},
                     {"frames", plan_.frames},
                     {"rate", hertz},
                     {"layout", plan_.raymap.layout},
                     {"width", plan_.raymap.width},
                     {"height", plan_.raymap.height},
                     {"codec", film::name_of(plan_.coding.codec)},
                     {"sound", plan_.sound ? Json(plan_.sound->path) : Json(nullptr)},
                     {"rendered_frames", done_},
                     {"seconds", seconds_},
                     {"processor_seconds", processor_seconds_},
                     {"blend_seconds", blending}};
    const std::string from = content_.tell(plan_, document);
    console_.document(document);
    console_.line(fmt::format("{}: {} of {}x{}, {:.2f} a second, {}, {}, from {} ({:.1f} s)", out_,
                              counted(plan_.frames, "frame"), plan_.raymap.width, plan_.raymap.height, hertz,
                              film::name_of(plan_.coding.codec), plan_.sound ? "with sound" : "without sound", from,
                              seconds_));
  }

  Console& console_;
  const std::string& out_;
  const PartsArgs& args_;
  const film::Programs& programs_;
  FilmContent& content_;
  film::PartsFolder parts_;
  std::vector<std::string>& notes_;
  film::FilmPlan plan_;
  std::unique_ptr<film::FrameSource> source_;  // refers to plan_
  std::uint64_t done_ = 0;
  double seconds_ = 0, processor_seconds_ = 0;
};

}  // namespace

void set_coding(film::FilmLook& look, const CodingArgs& args, const std::string& out) {
  if (!args.codec.empty()) look.codec = film::codec_named(args.codec);
  look.quality = args.quality;
  look.preset = args.preset.empty() && args.preview ? "veryfast" : args.preset;
  look.preview = args.preview;
  look.container = film::container_of(out).value_or(film::Container::kMp4);
}

std::string unknown_to_viewers(const std::string& layout) {
  return fmt::format("viewers are not told of the layout {}: only equirectangular films say what they are", layout);
}

tl::unexpected<Error> no_plan(const film::PartsFolder& parts) {
  return fail(Errc::kNotFound, fmt::format("{}: there is no plan; make the segments first", parts.path));
}

Status make_film(Console& console, const std::string& out, const PartsArgs& args, const film::Programs& programs,
                 FilmContent& content, std::vector<std::string>& notes) {
  return FilmWork(console, out, args, programs, content, notes).run();
}

}  // namespace nodal::host
