#include "host_tool/commands/stitch_job.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "host_tool/commands/expected_time.h"
#include "host_tool/console/files.h"
#include "host_tool/console/overwriting.h"
#include "host_tool/input/own_pictures.h"
#include "host_tool/output/layout_name.h"
#include "host_tool/report/registration_report.h"
#include "protocol/base/try.h"
#include "stitch/offline/best_blend.h"
#include "stitch/offline/offline_blend.h"

namespace nodal::host {
namespace {

/// The longest side of a result whose width nobody gave: ImageMagick's policy in Debian, browsers and graphics cards
/// open no longer ones, and FFmpeg no sphere of twice this width.
constexpr int kMaxUsualSide = 16000;

constexpr int kTakeSets = 3;  // used of a take or of films, when spheres are numbered

Status check_names(const std::string& out, const std::vector<std::vector<std::string>>& sets) {
  NODAL_TRY(check_output(out, sets, sets.size()));
  if (sets.size() == 1 || has_number(out)) return {};
  return fail(Errc::kBadValue, fmt::format("--out {}: there are {} sets of pictures, and every sphere needs a name of "
                                           "its own; put %04d into it",
                                           out, sets.size()));
}

/// Pictures without a calibration: finds one.
Status calibrate(Console& console, StitchJob& job, Progress& bar) {
  NODAL_TRY_ASSIGN(job.rig, own_pictures(job.args.inputs, parse_split(job.args.split).value()));
  RigPictures& rig = job.rig;
  const std::vector<std::vector<std::string>> files = rig.files();
  NODAL_TRY(check_names(job.args.out, files));
  for (const char* ending : {".rig.json", ".report.html"}) NODAL_TRY(check_free(beside(job.args.out, ending)));
  constexpr double kSpherePerPicture = 0.5;  // pixels of spheres for each pixel of pictures that overlap
  const double width = job.args.width, picture_px = pixels_of(rig.sets.front().front());
  const double sphere =
      width > 0 ? width * width / 2 : kSpherePerPicture * static_cast<double>(rig.heads.size()) * picture_px;
  say_time(console, {.placed = rig.heads.size(),
                     .picture_px = picture_px,
                     .blended_px = sphere * static_cast<double>(rig.sets.size())});
  // Matching takes about as long as the registration.
  const auto show = [&](double from, double done, const std::string& what) {
    bar.update(static_cast<std::uint64_t>(kCalibrated * (from + done / 2)), what);
  };
  const auto matched = calibrate_by_pictures(rig, parse_up(job.args.up).value(),
                                             [&](double done, const std::string& what) { show(0, done, what); });
  if (!matched) {
    for (const std::string& note : rig.notes) console.note("note: " + note);
    return fail(matched.error());
  }
  const PointMatch& match = *rig.match;
  if (files.size() > 1) {
    rig.notes.push_back(fmt::format("the calibration is from set {} of {}, with {}", match.set + 1, files.size(),
                                    files[match.set].front()));
  }
  registration::Report report =
      registered_alone(rig, [&](double done, const std::string& what) { show(0.5, done, what); });
  if (!report.pairs.empty()) {
    if (!match.lens.note.empty()) report.warnings.push_back(match.lens.note);
    NODAL_TRY_ASSIGN(job.details, registration_report(rig.calibration, rig.frames(match.set), report));
    rig.calibration = std::move(report.calibration);
  } else {
    rig.notes.insert(rig.notes.end(), report.warnings.begin(), report.warnings.end());
  }
  // They are stitched next, or else would be kept in memory while other sets are stitched.
  if (match.set > 0) {
    for (HeadPicture& picture : rig.sets[match.set]) picture.release();
  }
  return {};
}

/// Linear numbers need a response. A data sheet and most projects have none, and their pictures are files for people to
/// look at: sRGB.
void take_for_srgb(RigPictures& rig) {
  bool taken = false;
  for (HeadCalibration& head : rig.calibration.heads) {
    if (head.response.curve != Response::Curve::kLinear) continue;
    head.response.curve = Response::Curve::kSrgb;
    taken = true;
  }
  if (taken) rig.notes.push_back("the calibration does not say how numbers follow from light; sRGB is taken");
}

/// The widest sphere of which the part has no side over kMaxUsualSide.
double widest_usual(const StitchArgs& args, double share_of_width, double share_of_height) {
  const double widest = std::min(kMaxUsualSide / share_of_width, 2 * kMaxUsualSide / share_of_height);
  const double best_pixels = offline::BestBlend::kMaxPixels / (share_of_width * share_of_height);
  const double best_limit = best(args) ? std::sqrt(2 * best_pixels) : geometry::kMaxRaymapSide;
  return std::floor(std::min({widest, best_limit, double{geometry::kMaxRaymapSide}}) / 4) * 4;
}

/// Size, share and part of an equirectangular raymap.
Status plan_sphere(StitchJob& job, const geometry::LayoutName& layout, double natural) {
  const StitchArgs& args = job.args;
  const CropChoice crop = parse_crop(args.crop).value();
  const geometry::RaymapSize rough = layout.size_for_width(720);
  const Result<SeenPart> seen = seen_part(job.rig.calibration, rough);
  if (!seen) return fail(seen.error().in(args.inputs.front()));
  job.share = seen->share;
  const bool automatic = crop.kind == CropChoice::Kind::kAuto && seen->share < kMinSphereShare;
  // A part that is cut by the edge of the picture stays whole: viewers do not all know how it goes on.
  const bool wraps = seen->part.left + seen->part.width > rough.width;
  const auto share_of = [&](int part, int whole) { return automatic ? static_cast<double>(part) / whole : 1.0; };
  const double widest = widest_usual(args, wraps ? 1 : share_of(seen->part.width, rough.width),
                                     share_of(seen->part.height, rough.height));
  if (args.width == 0 && natural > widest) {
    job.rig.notes.push_back(fmt::format(
        "the result is as wide as other programs open it{}; as fine as the pictures it would be of a sphere of "
        "{:.0f} px: --width",
        best(args) ? " and --blend best makes it" : "", std::ceil(natural)));
  }
  job.size = layout.size_for_width(args.width > 0 ? args.width : std::min(natural, widest));
  if (args.width > 0 && job.size.width != args.width) {
    job.rig.notes.push_back(fmt::format("--width {}: the next width of this layout is {}", args.width, job.size.width));
  }
  if (crop.kind == CropChoice::Kind::kPart) {
    const RaymapPart& part = crop.part;
    if (part.left + part.width > job.size.width || part.top + part.height > job.size.height) {
      return fail(Errc::kBadValue, fmt::format("--crop {}: the part is not within the sphere, which has {}x{} pixels; "
                                               "give --width, too",
                                               args.crop, job.size.width, job.size.height));
    }
    job.part = part;
  } else if (automatic) {
    NODAL_TRY_ASSIGN(SeenPart fine, seen_part(job.rig.calibration, job.size));
    if (fine.part.left + fine.part.width > job.size.width) fine.part.left = 0, fine.part.width = job.size.width;
    job.part = fine.part;
    job.part_is_all_seen = true;
    job.rig.notes.push_back(
        fmt::format("the pictures show {:.0f} % of the sphere, so the result is cropped to what they "
                    "show; --crop none gives the whole one",
                    std::ceil(100 * job.share)));
  }
  return {};
}

}  // namespace

std::string beside(const std::string& out, const std::string& ending) {
  const std::filesystem::path path(out);
  std::string name = path.stem().string();
  if (has_number(out)) {
    const std::size_t from = name.find('%');
    name.erase(from, name.find('d', from) + 1 - from);
    name.erase(name.find_last_not_of("-_.") + 1);
    if (name.empty()) name = "sphere";
  }
  return (path.parent_path() / (name + ending)).string();
}

Result<StitchJob> make_stitch_job(Console& console, const StitchArgs& args, Progress& bar) {
  StitchJob job;
  job.args = args;
  const Result<geometry::LayoutName> layout = layout_named(args.layout);
  if (!layout) return fail(layout.error().in("--layout"));
  job.args.layout = layout->text();
  if (!has_number(args.out)) NODAL_TRY(check_free(args.out));
  const Result<media::RaymapFormat> format = media::raymap_format_of_name(args.out);
  if (!format) return fail(format.error().in("--out"));
  job.format = *format;
  if (args.bits == 16 && job.format == media::RaymapFormat::kJpg) {
    return fail(Errc::kBadValue, "--bits 16: a JPEG has 8 bits; let --out end in .png, .tif or .raw");
  }
  if (args.nominal.rig.empty() && is_picture(args.inputs.front())) {
    NODAL_TRY(calibrate(console, job, bar));
  } else {
    NODAL_TRY_ASSIGN(job.rig, read_rig_pictures(args.nominal, args.inputs,
                                                {args.places, parse_split(args.split).value(),
                                                 has_number(args.out) ? kTakeSets : 1}));
    NODAL_TRY(turn_up(job.rig, parse_up(args.up).value()));
    const bool imported = job.rig.origin != RigPictures::Origin::kCalibration;
    if (args.bits == 16 && imported) take_for_srgb(job.rig);
  }
  if (args.distance > 0) {
    job.rig.calibration.distance = args.distance;
    if (const Status good = check_calibration(job.rig.calibration); !good) return fail(good.error().in("--distance"));
  }
  NODAL_TRY(check_names(args.out, job.rig.files()));
  const Result<double> resolution = offline::resolution_of(job.rig.calibration);
  if (!resolution) return fail(resolution.error().in(args.inputs.front()));
  const double natural = layout->width_for_resolution(*resolution);
  if (!layout->is_equirectangular()) {
    if (parse_crop(args.crop)->kind == CropChoice::Kind::kPart) {
      return fail(Errc::kBadValue, "--crop: only equirectangular pictures can be cropped; leave out --layout");
    }
    job.size = layout->size_for_width(args.width > 0 ? args.width : std::min<double>(natural, kMaxUsualSide));
  } else {
    NODAL_TRY(plan_sphere(job, *layout, natural));
  }
  if (!job.rig.match) {
    const RaymapPart part = job.part.value_or(RaymapPart{0, 0, job.size.width, job.size.height});
    const double pixels = static_cast<double>(part.width) * part.height * static_cast<double>(job.rig.sets.size());
    if (best(args)) say_time(console, {.blended_px = pixels});
  }
  return job;
}

}  // namespace nodal::host
