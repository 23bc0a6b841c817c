#include "host_tool/commands/film_calibration.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <utility>

#include "host_tool/console/files.h"
#include "host_tool/console/interrupt.h"
#include "host_tool/film/attempts.h"
#include "host_tool/film/still_moments.h"
#include "protocol/base/try.h"

namespace nodal::host {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kTried = 3;  // moments
constexpr double kStill = 0.35;    // share of the detail that changes from frame to frame; noise of a camera is below

/// Films whose heads the calibration does not have, with commas between them.
std::string missing(const Calibration& calibration, const std::vector<film::FilmFile>& films,
                    const std::vector<std::string>& names) {
  std::string all;
  for (std::size_t h = 0; h < films.size(); ++h) {
    if (std::ranges::find(calibration.heads, names[h], &HeadCalibration::name) != calibration.heads.end()) continue;
    all += (all.empty() ? "" : ", ") + films[h].path;
  }
  return all;
}

/// A still from the frames of one moment.
Result<StitchedPictures> still_of(Console& console, StitchArgs args, const film::Programs& programs,
                                  const std::vector<film::FilmFile>& films, const std::vector<std::string>& names,
                                  const film::Moment& moment, const std::string& folder) {
  args.inputs.clear();
  for (std::size_t h = 0; h < films.size(); ++h) {
    NODAL_TRY_ASSIGN(const auto png, film::png_of(programs, films[h], moment.frames[h]));
    args.inputs.push_back((fs::path(folder) / (names[h] + ".png")).string());
    NODAL_TRY(write_file(args.inputs.back(), png));
  }
  args.out = beside(args.out, ".jpg");
  args.split = "none";  // the films are split already
  args.width = 0;
  NODAL_TRY_ASSIGN(StitchedPictures made, stitch_pictures(console, args));
  if (const std::string films_left = missing(made.calibration, films, names); !films_left.empty()) {
    return fail(Errc::kNoCoverage,
                fmt::format("no place is found for {} by what it shows at {:.1f} s; film something with more detail "
                            "where heads overlap, leave these films out, or give a calibration in front of the films",
                            films_left, films.front().seconds(moment.frames.front())));
  }
  return made;
}

/// A folder for frames, in the folder of the film's parts, until it goes. Its name is of this attempt alone, so that
/// what is removed is its own.
class FrameFolder {
 public:
  static Result<FrameFolder> make(const std::string& folder) {
    std::error_code error;
    fs::create_directories(folder, error);
    film::remove_dead_attempts(folder + "/");
    const std::string path = film::attempt_name(folder + "/frames");
    const bool is_new = !error && fs::create_directory(path, error);
    if (!is_new) {
      return fail(Errc::kIo, fmt::format("{}: cannot be made: {}", path, error ? error.message() : "it is there"));
    }
    return FrameFolder(path);
  }
  FrameFolder(FrameFolder&& other) noexcept : path_(std::exchange(other.path_, {})) {}
  FrameFolder& operator=(FrameFolder&&) = delete;
  ~FrameFolder() {
    std::error_code error;
    if (!path_.empty()) fs::remove_all(path_, error);
  }
  const std::string& path() const { return path_; }

 private:
  explicit FrameFolder(std::string path) : path_(std::move(path)) {}
  std::string path_;
};

}  // namespace

Result<PictureSplit> split_of_film(const film::Programs& programs, const film::FilmFile& film,
                                   const std::string& choice, const std::string& folder) {
  NODAL_TRY_ASSIGN(const SplitChoice chosen, parse_split(choice));
  PictureSplit split = chosen.split;
  if (chosen.find) {
    NODAL_TRY_ASSIGN(const FrameFolder frames, FrameFolder::make(folder));
    const std::string frame = frames.path() + "/frame.png";
    NODAL_TRY_ASSIGN(const auto png, film::png_of(programs, film, film.times.size() / 2));
    NODAL_TRY(write_file(frame, png));
    NODAL_TRY_ASSIGN(split, find_circles(frame));
  }
  if (split.count() > 1) return split;
  return fail(Errc::kMissingField, film.path +
                                       ": this is one film with one track of pictures, and it does not show two "
                                       "circles; give a film of each head, or --split if their pictures are "
                                       "side by side");
}

Result<StitchedPictures> calibrate_films(Console& console, const StitchArgs& args, const film::Programs& programs,
                                         const std::vector<film::FilmFile>& films,
                                         const std::vector<std::string>& names,
                                         const std::vector<film::HeadTime>& times, bool timed,
                                         const std::string& folder) {
  std::vector<film::Moment> moments;
  {
    Progress bar(console, "choosing frames", 100);
    NODAL_TRY_ASSIGN(moments, film::still_moments(programs, films, times, [&](double part) {
                       bar.update(static_cast<std::uint64_t>(100 * part), "");
                       return !interrupted();
                     }));
  }
  if (!timed) {
    std::erase_if(moments, [](const film::Moment& moment) { return moment.motion > kStill; });
    if (moments.empty()) {
      return fail(Errc::kNotDetermined,
                  "the films' times are not known by their sound, and the rig never stands still, so that no frames of "
                  "one instant can be chosen for a calibration; keep the rig still for some seconds, or use --times "
                  "begin if one signal started all cameras, or give a calibration in front of the films");
    }
  }
  NODAL_TRY_ASSIGN(const FrameFolder frames, FrameFolder::make(folder));
  Result<StitchedPictures> made = fail(Errc::kNotDetermined, "not tried");
  for (std::size_t k = 0; k < std::min(kTried, moments.size()) && !made; ++k) {
    const double at = films.front().seconds(moments[k].frames.front());
    console.note(fmt::format("note: no calibration is given; it is looked for in the frames at {:.1f} s of {}", at,
                             films.front().path));
    made = still_of(console, args, programs, films, names, moments[k], frames.path());
    const bool other_frames =
        !made && (made.error().code == Errc::kNoCoverage || made.error().code == Errc::kNotDetermined ||
                  made.error().code == Errc::kHeadMismatch);
    if (!other_frames) break;
  }
  return made;
}

}  // namespace nodal::host
