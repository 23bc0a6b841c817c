#include "host_tool/commands/stitch_pictures.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <functional>
#include <optional>
#include <span>

#include "host_tool/commands/lens_json.h"
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

}  // namespace

Result<StitchedPictures> stitch_pictures(Console& console, const StitchArgs& args) {
  const auto begin = std::chrono::steady_clock::now();
  Progress bar(console, "stitching", kStitched);
  NODAL_TRY_ASSIGN(StitchJob job, interruptible(console, [&] { return make_stitch_job(console, args, bar); }));
  for (const std::string& note : job.rig.notes) console.note("note: " + note);
  const std::size_t count = job.rig.sets.size();
  NODAL_TRY_ASSIGN(const Stitched stitched, stitch_sets(console, job, bar));
  console.finish_progress();
  const RaymapPart made = job.part.value_or(RaymapPart{0, 0, job.size.width, job.size.height});
  const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  StitchedPictures answer{job.rig.calibration, {}, {}};
  answer.document = {{"raymaps", count},
                     {"out", stitched.last},
                     {"layout", job.args.layout},
                     {"width", made.width},
                     {"height", made.height},
                     {"share", job.share},
                     {"calibration", to_hex(calibration_id(job.rig.calibration))},
                     {"verdict", name_of(stitched.verdict.word)},
                     {"seams", to_json(stitched.verdict, job.rig.heads)},
                     {"seconds", seconds}};
  if (job.rig.match) add_match(job, answer.document);
  if (job.part) {
    answer.document["crop"] = {
        {"left", made.left}, {"top", made.top}, {"full_width", job.size.width}, {"full_height", job.size.height}};
  }
  if (job.rig.match) {
    answer.lines.push_back(job.rig.match->confidence);
    answer.lines.push_back(
        fmt::format("calibration: {}, report: {}", beside(args.out, ".rig.json"), beside(args.out, ".report.html")));
  }
  answer.lines.push_back((count == 1 ? "" : "first sphere: ") + stitched.verdict.sentence);
  answer.lines.push_back(fmt::format("{}: {}x{}, {}, from {} heads ({:.1f} s)", count == 1 ? stitched.last : args.out,
                                     made.width, made.height, job.args.layout, job.rig.calibration.heads.size(),
                                     seconds));
  return answer;
}

}  // namespace nodal::host
