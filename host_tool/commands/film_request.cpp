#include "host_tool/commands/film_request.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <filesystem>

#include "host_tool/console/quantities.h"
#include "host_tool/film/film_list.h"
#include "host_tool/input/calibration_file.h"
#include "host_tool/input/pictures.h"
#include "host_tool/output/layout_name.h"
#include "protocol/base/try.h"
#include "stitch/media/picture_bytes.h"
#include "stitch/offline/offline_blend.h"

namespace nodal::host {
namespace {

namespace fs = std::filesystem;

constexpr int kWidestUsual = 4096;  // px: what players decode as H.264

tl::unexpected<Error> not_for_films(const std::string& option, const std::string& why) {
  return fail(Errc::kUnsupported, fmt::format("{}: {}; leave it out", option, why));
}

/// The films in the order of the heads: by their names if these are the heads' names, else as they are given.
Result<std::vector<std::string>> films_of(const Calibration& calibration, const std::string& name,
                                          const std::vector<std::string>& films, std::vector<std::string>& notes) {
  if (films.size() == 1) return std::vector<std::string>(calibration.heads.size(), films.front());
  if (films.size() != calibration.heads.size()) {
    return fail(Errc::kHeadMismatch,
                fmt::format("{}: the calibration has {}, and there are {}; give one film for each "
                            "head, in its order, or one film with a track for each",
                            name, counted(calibration.heads.size(), "head"), counted(films.size(), "film")));
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

}  // namespace

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

bool films_alone(const StitchArgs& args) {
  std::error_code error;
  return film::is_film_name(args.inputs.front()) || fs::is_directory(args.inputs.front(), error);
}

Result<std::vector<std::string>> one_for_each_head(const film::Programs& programs, const StitchArgs& args, int rate,
                                                   const std::string& folder) {
  const bool alone = films_alone(args);
  const std::vector<std::string> given(args.inputs.begin() + (alone ? 0 : 1), args.inputs.end());
  for (const std::string& input : given) {
    if (!film::is_list(input)) continue;
    return fail(Errc::kUnsupported,
                fmt::format("{}: it is no film but a list that names other files; name the films", input));
  }
  NODAL_TRY_ASSIGN(const auto heads, film::files_of_heads(given));
  const auto size_of = [](const std::string& file) -> Result<film::PictureSize> {
    NODAL_TRY_ASSIGN(media::PictureBytes bytes, media::PictureBytes::open(file));
    NODAL_TRY_ASSIGN(const ImageHeader header, read_picture_header(bytes));
    return film::PictureSize{header.width, header.height};
  };
  std::vector<std::string> inputs;
  if (!alone) inputs.push_back(args.inputs.front());
  for (const film::HeadFiles& head : heads) {
    const auto named = std::ranges::find_if(
        given, [&](const std::string& input) { return fs::absolute(input) == head.files.front(); });
    if (head.files.size() == 1 && named != given.end()) {
      inputs.push_back(*named);
      continue;
    }
    NODAL_TRY_ASSIGN(std::string list, film::make_list(programs, head, rate, size_of, fs::absolute(folder).string()));
    inputs.push_back(std::move(list));
  }
  return inputs;
}

Result<std::vector<film::HeadTime>> given_times(const FilmArgs& words) {
  std::vector<film::HeadTime> times;
  for (const std::string& text : words.offsets) {
    NODAL_TRY_ASSIGN(film::HeadTime time, film::parse_head_time(text));
    times.push_back(std::move(time));
  }
  return times;
}

Result<std::vector<film::FilmFile>> probe_films(const film::Programs& programs, const film::FilmRequest& request,
                                                const PictureSplit& split) {
  std::vector<film::FilmFile> films;
  for (const std::string& path : request.films) {
    const auto n = static_cast<int>(films.size());
    NODAL_TRY_ASSIGN(film::FilmFile film, film::probe(programs, path, request.one_file && split.count() == 1 ? n : 0));
    if (film.tracks > 1 && !request.one_file) {
      return fail(Errc::kUnsupported, fmt::format("{}: it has {} tracks of pictures; give it alone, for a rig of as "
                                                  "many heads, or copy one track into a file of its own: ffmpeg -i "
                                                  "FILE -map 0:v:0 -c copy FILE2",
                                                  path, film.tracks));
    }
    films.push_back(split.count() > 1 ? film::part_of(std::move(film), split.columns, split.rows, n) : std::move(film));
  }
  return films;
}

Result<std::vector<film::FilmFile>> probe_films(const film::Programs& programs, const film::FilmRequest& request) {
  PictureSplit split;
  const std::vector<HeadCalibration>& heads = request.calibration.heads;
  if (request.one_file) {
    NODAL_TRY_ASSIGN(const film::FilmFile whole, film::probe(programs, request.films.front()));
    const PictureSplit beside{whole.width / heads.front().width, whole.height / heads.front().height};
    if (whole.tracks == 1 && beside.count() == heads.size()) split = beside;
  }
  NODAL_TRY_ASSIGN(std::vector<film::FilmFile> films, probe_films(programs, request, split));
  for (std::size_t h = 0; h < films.size(); ++h) {
    const HeadCalibration& head = heads[h];
    if (films[h].width == head.width && films[h].height == head.height) continue;
    return fail(
        Errc::kHeadMismatch,
        fmt::format("{}: its pictures have {}x{} pixels, and head '{}' is calibrated for {}x{}{}", films[h].path,
                    films[h].width, films[h].height, head.name, head.width, head.height,
                    films[h].rotation_deg != 0 ? ", as they are coded, before they are rotated as the file says" : ""));
  }
  return films;
}

Result<film::FilmRequest> make_request(Console& console, const StitchArgs& args, const FilmArgs& words,
                                       const std::optional<Calibration>& found, std::vector<std::string>& notes) {
  if (!args.nominal.rig.empty()) {
    return not_for_films("--nominal", "the lenses of films are found in their frames, or given by a calibration");
  }
  if (args.bits == 16) return not_for_films("--bits 16", "films have 8 bits");
  if (args.crop != "auto" && args.crop != "none") return not_for_films("--crop", "a film has the whole sphere");
  if (args.up != "auto" && !found) return not_for_films("--up", "a film's sphere stands as the calibration says");
  film::FilmRequest request;
  if (found) {
    request.calibration = *found;
  } else {
    NODAL_TRY_ASSIGN(request.calibration, read_calibration(args.inputs.front(), console));
  }
  if (args.distance > 0) {
    request.calibration.distance = args.distance;
    if (const Status good = check_calibration(request.calibration); !good) return fail(good.error().in("--distance"));
  }
  const std::vector<std::string> given(args.inputs.begin() + (found ? 0 : 1), args.inputs.end());
  NODAL_TRY_ASSIGN(const auto films, films_of(request.calibration, args.inputs.front(), given, notes));
  request.one_file = given.size() == 1 && films.size() > 1;
  for (const std::string& path : films) request.films.push_back(fs::absolute(path).string());
  NODAL_TRY_ASSIGN(request.times, given_times(words));
  request.times_by = words.times;
  request.readout_s = words.readout_ms / 1000;
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
  const geometry::RaymapSize size = layout->size_for_width(
      args.width > 0 ? args.width : std::min<double>(natural, words.coding.preview ? kPreviewWidth : kWidestUsual));
  request.raymap.layout = layout->text();
  request.raymap.width = size.width;
  request.raymap.height = size.height;
  request.raymap.seam_width_deg = args.seam_width_deg;
  request.raymap.feather = args.feather;
  if (args.transition == "seam") request.raymap.transition = Transition::kSeam;
  if (args.transition == "feather") request.raymap.transition = Transition::kFeather;
  request.matched = words.light == "matched";
  const bool placed = words.seams == "placed" && args.transition != "feather";
  request.raymap.seams = placed ? SeamPlacement::kPlaced : SeamPlacement::kFixed;
  set_coding(request, words.coding, args.out);
  if (!layout->is_equirectangular()) {
    notes.push_back(unknown_to_viewers(request.raymap.layout));
  }
  return request;
}

}  // namespace nodal::host
