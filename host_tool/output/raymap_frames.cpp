#include "host_tool/output/raymap_frames.h"

#include <fmt/format.h>

#include <array>
#include <chrono>

#include "host_tool/console/console.h"
#include "host_tool/console/files.h"
#include "host_tool/console/interrupt.h"
#include "host_tool/console/overwriting.h"
#include "host_tool/output/cube_faces.h"
#include "host_tool/output/raymap_sink.h"
#include "host_tool/output/raymap_source.h"
#include "host_tool/output/turned_pose.h"
#include "protocol/base/try.h"
#include "stitch/media/raymap/raymap_file.h"

namespace nodal::host {
namespace {

class Stopwatch {
 public:
  double seconds() const { return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin_).count(); }

 private:
  std::chrono::steady_clock::time_point begin_ = std::chrono::steady_clock::now();
};

/// The six faces of a cube, side by side.
Result<RaymapInput> read_faces(const std::vector<std::string>& inputs) {
  NODAL_TRY_ASSIGN(const auto files, face_files(inputs));
  std::array<DecodedImage, kFaces> faces;
  for (std::size_t face = 0; face < kFaces; ++face) {
    NODAL_TRY_ASSIGN(RaymapInput input, read_raymap(files[face], false));
    faces[face] = std::move(input.picture);
  }
  NODAL_TRY_ASSIGN(DecodedImage row, row_of_faces(faces));
  return RaymapInput{std::move(row), false};
}

/// What all pictures of one size become.
struct FrameJob {
  geometry::RaymapSize made;
  std::optional<geometry::LayoutName> layout;                             ///< layout of the results; nothing for a view
  std::function<DecodedImage(const DecodedImage&, std::size_t k)> paint;  ///< picture k
  double plan_seconds = 0;
  std::optional<Eigen::Matrix3d> R_new_old = std::nullopt;  ///< the sphere is turned
};

/// `of`: the picture that `made` was made of. A view is another look at the sphere: what was said of the whole is not
/// true of it.
Result<std::vector<std::uint8_t>> encode(DecodedImage&& made, const DecodedImage& of, media::RaymapFormat format,
                                         const FrameJob& job, int quality) {
  const std::optional<geometry::LayoutName>& layout = job.layout;
  made.meaning = of.meaning;
  media::RaymapFile file;
  file.format = format;
  file.quality = quality;
  file.comment = layout ? "nodal convert layout=" + layout->text() : "nodal view";
  if (layout) file.layout = layout->text();
  const media::Keep same = job.R_new_old ? media::Keep::kTurned : media::Keep::kAll;
  file.kept = media::kept_metadata(of.metadata, layout ? same : media::Keep::kPlaceAndTime);
  if (job.R_new_old) turn_pose(file.kept.properties, *job.R_new_old);
  return media::encode(made, file);
}

struct FaceFiles {
  std::string out;
  media::RaymapFormat format = media::RaymapFormat::kJpg;
  int quality = 92;
};

/// A face alone is a picture of 90 degrees: place and time are true of it.
Status write_faces(Console& console, const DecodedImage& row, const DecodedImage& of, const FaceFiles& files) {
  for (std::size_t face = 0; face < kFaces; ++face) {
    NODAL_TRY_ASSIGN(const auto bytes, interruptible(console, [&] {
                       DecodedImage one = face_of_row(row, face);
                       one.meaning = of.meaning;
                       media::RaymapFile file;
                       file.format = files.format;
                       file.quality = files.quality;
                       file.comment = fmt::format("nodal convert face={}", kFaceNames[face]);
                       file.kept = media::kept_metadata(of.metadata, media::Keep::kPlaceAndTime);
                       return media::encode(one, file);
                     }));
    NODAL_TRY(write_file(face_file(files.out, face), bytes));
  }
  return {};
}

/// Alpha is left out of results, which are of whole spheres or views.
void tell_alpha(Console& console, const std::string& file, const DecodedImage& picture) {
  if (picture.meaning.alpha) console.note(fmt::format("note: {} has an alpha channel, which is left out", file));
}

/// How many pictures are made.
std::size_t count_of(const FrameOptions& options) {
  if (options.pictures > 0) return options.pictures;
  return options.faces_in ? 1 : options.inputs.size();
}

Status check_names(const FrameOptions& options) {
  if (options.out == "-" && options.faces_out) {
    return fail(Errc::kBadValue, "--out -: six files cannot be sent on; give a name such as cube.jpg");
  }
  if (options.out == "-") return {};
  for (std::size_t face = 0; face < kFaces && options.faces_out; ++face) {
    const std::string file = face_file(options.out, face);
    NODAL_TRY(check_output(file, {options.inputs}, count_of(options)));
    if (!has_number(file)) NODAL_TRY(check_free(file));
  }
  const std::size_t count = count_of(options);
  if (count > 1 && !has_number(options.out)) {
    return fail(Errc::kBadValue,
                fmt::format("--out {}: there will be {} pictures, and every one needs a name of its own; "
                            "put %04d into it, or give - to send them on",
                            options.out, count));
  }
  if (options.faces_out) return {};  // the six names are what is written
  if (!has_number(options.out)) {
    if (const Status free = check_free(options.out); !free) return fail(free.error().in("--out"));
  }
  return check_output(options.out, {options.inputs}, count);
}

/// Reads every input, paints and writes it. `begin` is called with the first.
Status run_frame_job(Console& console, const FrameOptions& options,
                     const std::function<Result<FrameJob>(const RaymapInput& first)>& begin) {
  const Stopwatch whole;
  double resampling_seconds = 0;
  const bool piped = options.out == "-";
  NODAL_TRY(piped ? check_pipe(console) : Status{});
  const Result<media::RaymapFormat> format =
      piped ? media::RaymapFormat::kJpg : media::raymap_format_of_name(options.out);
  if (!format) return fail(format.error().in("--out"));
  NODAL_TRY(check_names(options));
  const std::size_t count = count_of(options);
  std::optional<FrameJob> job;
  geometry::RaymapSize size;  // size of the first picture
  std::string last;
  std::optional<RaymapInput> input;
  {
    Progress bar(console, "resampling", count);
    for (std::size_t k = 0; k < count; ++k) {
      if (interrupted()) return fail(Errc::kCancelled, fmt::format("stopped after {} of {} pictures", k, count));
      if (k < options.inputs.size()) {
        NODAL_TRY_ASSIGN(RaymapInput read, interruptible(console, [&] {
                           return options.faces_in ? read_faces(options.inputs)
                                                   : read_raymap(options.inputs[k], options.from.empty());
                         }));
        input = std::move(read);
      }
      const DecodedImage& picture = input->picture;
      if (!job) {
        NODAL_TRY_ASSIGN(FrameJob begun, begin(*input));
        job.emplace(std::move(begun));
        size = {picture.width, picture.height};
        tell_alpha(console, options.inputs[k], picture);
      }
      if (picture.width != size.width || picture.height != size.height) {
        return fail(Errc::kBadValue,
                    fmt::format("{}: it has {}x{} pixels, and the first one has {}x{}; give spheres of "
                                "one size",
                                options.inputs[k], picture.width, picture.height, size.width, size.height));
      }
      const Stopwatch watch;
      DecodedImage result = interruptible(console, [&] { return job->paint(picture, k); });
      resampling_seconds += watch.seconds();
      if (options.faces_out) {
        last = numbered_name(options.out, k).value();
        NODAL_TRY(write_faces(console, result, picture, {last, *format, options.quality}));
        bar.update(k + 1, last);
        continue;
      }
      NODAL_TRY_ASSIGN(const auto file, interruptible(console, [&] {
                         return encode(std::move(result), picture, *format, *job, options.quality);
                       }));
      if (piped) {
        console.bytes({reinterpret_cast<const char*>(file.data()), file.size()});
        continue;
      }
      last = numbered_name(options.out, k).value();
      NODAL_TRY(write_file(last, file));
      bar.update(k + 1, last);
    }
  }
  if (piped) return {};
  Json document{{"pictures", count},
                {"out", last},
                {"width", job->made.width},
                {"height", job->made.height},
                {"seconds", whole.seconds()},
                {"plan_seconds", job->plan_seconds},
                {"resampling_seconds", resampling_seconds}};
  if (job->layout) document["layout"] = job->layout->text();
  console.document(document);
  console.line(fmt::format("{}: {}x{}{} ({:.1f} s)", count == 1 ? last : options.out, job->made.width, job->made.height,
                           job->layout ? ", " + job->layout->text() : "", whole.seconds()));
  return {};
}

}  // namespace

Status run_frames(Console& console, const FrameOptions& options,
                  const std::function<Result<Outcome>(double pixels_per_radian)>& outcome) {
  const parallel::Workers workers(options.threads);
  const view::Filter filter = view::parse_filter(options.filter).value();
  std::unique_ptr<geometry::RaymapLayout> source;
  std::optional<view::Resampler> resampler;
  view::Resampler::Plan plan;
  return run_frame_job(console, options, [&](const RaymapInput& first) -> Result<FrameJob> {
    NODAL_TRY_ASSIGN(RaymapSource from, source_of(options.from, options.inputs.front(), first));
    if (const std::string warning = shape_warning(options.inputs.front(), from, first); !warning.empty())
      console.warning(warning);
    source = std::move(from.layout);
    NODAL_TRY_ASSIGN(const Outcome made, outcome(from.pixels_per_radian));
    const Stopwatch watch;
    interruptible(console, [&] {
      resampler.emplace(*source, filter, workers);
      plan = resampler->plan(made.target, workers);
    });
    return FrameJob{{made.target.width, made.target.height},
                    made.layout,
                    [&, target_of = made.target_of](const DecodedImage& raymap, std::size_t k) {
                      if (target_of && k > 0) plan = resampler->plan(target_of(k), workers);
                      return resampler->resample(raymap.view(), plan, workers);
                    },
                    watch.seconds(),
                    made.R_new_old};
  });
}

Status run_frames_as(Console& console, const FrameOptions& options, geometry::RaymapSize size,
                     const std::function<DecodedImage(const DecodedImage& raymap)>& paint) {
  return run_frame_job(console, options, [&](const RaymapInput&) -> Result<FrameJob> {
    return FrameJob{size, std::nullopt, [&](const DecodedImage& raymap, std::size_t) { return paint(raymap); }, 0};
  });
}

}  // namespace nodal::host
