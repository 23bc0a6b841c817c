#include "host_tool/film/film_plan.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <filesystem>

#include "host_tool/film/film_join.h"
#include "host_tool/film/film_list.h"
#include "host_tool/film/film_time.h"
#include "host_tool/film/spherical_mp4.h"
#include "protocol/base/sha256.h"
#include "protocol/base/try.h"
#include "protocol/base/version.h"
#include "protocol/files/open_file.h"

namespace nodal::film {
namespace {

Result<double> number(std::string_view text) {
  if (text.starts_with('+')) text.remove_prefix(1);
  double value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error == std::errc() && end == text.data() + text.size() && std::isfinite(value)) return value;
  return fail(Errc::kBadValue, fmt::format("'{}' is no number", text));
}

PixelFormat raymap_format(const std::vector<FilmFile>& films) {
  const auto all = [&](PixelFormat format) {
    return std::ranges::all_of(films, [&](const FilmFile& film) { return film.format == format; });
  };
  if (all(PixelFormat::kGrey8)) return PixelFormat::kGrey8;
  if (all(PixelFormat::kRgb24)) return PixelFormat::kRgb24;
  return PixelFormat::kI420;
}

/// The frame of every head for every instant, and the notes about that.
Status choose_frames(FilmPlan& plan, const std::vector<FilmFile>& films, const std::vector<HeadTime>& times,
                     const FilmSpan& span, std::vector<std::string>& notes) {
  const double period = 1.0 * plan.coding.rate.denominator / plan.coding.rate.numerator;
  plan.frames = span.frames;
  for (std::size_t h = 0; h < films.size(); ++h) {
    PlannedHead& head = plan.heads[h];
    const std::vector<std::size_t> chosen = nearest_frames(films[h], times[h], span, period, &head.farthest_s);
    for (const std::size_t frame : chosen) head.times.push_back(films[h].times[frame]);
    if (head.farthest_s > 0.001) {
      notes.push_back(fmt::format("{}: its frames are up to {:.1f} ms from the instant that they are shown at",
                                  films[h].path, 1000 * head.farthest_s));
    }
    const FrameRate own = usual_rate(*films[h].rate);
    if (own.numerator != plan.coding.rate.numerator || own.denominator != plan.coding.rate.denominator) {
      notes.push_back(
          fmt::format("{}: it has {:.3f} frames a second, and the result has {:.3f}; the nearest ones are "
                      "shown",
                      films[h].path, 1.0 * own.numerator / own.denominator, 1 / period));
    }
  }
  if (!span.ends_early.empty()) notes.push_back(span.ends_early);
  return {};
}

/// The head that has the sound, or a file of its own.
Result<std::optional<PlannedSound>> choose_sound(const FilmRequest& request, const std::vector<FilmFile>& films,
                                                 const std::vector<HeadTime>& times, const FilmSpan& span,
                                                 const Programs& programs) {
  if (request.sound == "none") return std::nullopt;
  for (std::size_t h = 0; h < films.size(); ++h) {
    const bool chosen = request.sound == times[h].head || (request.sound == "auto" && films[h].sound);
    if (!chosen) continue;
    if (!films[h].sound) {
      return fail(Errc::kBadValue, fmt::format("--sound {}: {} has no sound; choose another head, a file, or none",
                                               request.sound, films[h].path));
    }
    const double first = seconds_of(films[h].times.front(), films[h].time_base);
    return PlannedSound{films[h].path, films[h].sound->codec, first + head_seconds(times[h], span.from_s),
                        times[h].ppm};
  }
  if (request.sound == "auto") return std::nullopt;
  const auto sound = probe_sound(programs, request.sound);
  if (!sound) return fail(sound.error().in("--sound"));
  return PlannedSound{request.sound, sound->codec, sound->starts_s + span.from_s, 0};
}

}  // namespace

Result<Json> identity_of(const std::string& path) {
  // To read all of an hour's film would take minutes.
  const std::uint64_t ends = is_list(path) ? std::uint64_t{1} << 26 : std::uint64_t{1} << 16;
  const Result<FilePtr> file = open_to_read(path);
  if (!file) return fail(file.error().in(path));
  std::error_code error;
  const std::uint64_t size = std::filesystem::file_size(path, error);
  if (error) return fail(Errc::kIo, fmt::format("{}: {}", path, error.message()));
  std::vector<std::uint8_t> bytes(std::min(size, 2 * ends));
  const std::uint64_t front = std::min(size, ends), back = bytes.size() - front;
  const bool read = std::fread(bytes.data(), 1, front, file->get()) == front &&
                    ::fseeko(file->get(), static_cast<off_t>(size - back), SEEK_SET) == 0 &&
                    std::fread(bytes.data() + front, 1, back, file->get()) == back;
  if (!read) return fail(Errc::kIo, fmt::format("{}: it cannot be read", path));
  return Json{{"file", path}, {"bytes", size}, {"ends", to_hex(sha256(bytes))}};
}

Result<HeadTime> parse_head_time(const std::string& text) {
  const std::size_t equals = text.rfind('=');
  if (equals == std::string::npos || equals == 0) {
    return fail(Errc::kBadValue,
                fmt::format("'{}': write HEAD=SECONDS or HEAD=SECONDS,PPM, such as cam3=-0.0417,43", text));
  }
  HeadTime time{text.substr(0, equals)};
  const std::string rest = text.substr(equals + 1);
  const std::size_t comma = rest.find(',');
  const auto offset = number(std::string_view(rest).substr(0, comma));
  if (!offset) return fail(offset.error().in(text));
  time.offset_s = *offset;
  if (comma != std::string::npos) {
    const auto ppm = number(std::string_view(rest).substr(comma + 1));
    if (!ppm) return fail(ppm.error().in(text));
    time.ppm = *ppm;
  }
  constexpr double kMaxPpm = 10'000, kMaxOffset = 100'000;
  if (std::abs(time.ppm) > kMaxPpm || std::abs(time.offset_s) > kMaxOffset) {
    return fail(Errc::kBadValue, fmt::format("'{}': at most {} s and {} ppm", text, kMaxOffset, kMaxPpm));
  }
  return time;
}

Result<Json> words_of(const FilmRequest& request, const Programs& programs) {
  Json films = Json::array(), times = Json::array();
  for (const std::string& path : request.films) {
    NODAL_TRY_ASSIGN(Json film, identity_of(path));
    const auto same = std::ranges::find_if(films, [&](const Json& other) { return other["ends"] == film["ends"]; });
    if (same != films.end() && !request.one_file) {
      return fail(Errc::kBadValue, fmt::format("{}: it is the same film as {}; give each head its own", path,
                                               (*same)["file"].get<std::string>()));
    }
    films.push_back(std::move(film));
  }
  for (const HeadTime& time : request.times) times.push_back({time.head, time.offset_s, time.ppm});
  Json sound = request.sound;
  if (request.sound.find('/') != std::string::npos) {
    NODAL_TRY_ASSIGN(sound, identity_of(request.sound));
  }
  Json words{{"calibration", to_hex(calibration_id(request.calibration))},
             {"films", films},
             {"offsets", times},
             {"times", request.times_by},
             {"readout", request.readout_s},
             {"light", request.matched ? "matched" : "fixed"},
             {"sound", sound}};
  add_words(words, request, programs);
  return words;
}

void add_words(Json& words, const FilmLook& look, const Programs& programs) {
  const RaymapConfig& raymap = look.raymap;
  words["nodal"] = NODAL_VERSION;
  words["ffmpeg"] = programs.version;
  words["layout"] = raymap.layout;
  words["width"] = raymap.width;
  words["height"] = raymap.height;
  words["transition"] = static_cast<int>(raymap.transition);
  words["seam_width"] = raymap.seam_width_deg;
  words["feather"] = raymap.feather;
  words["seams"] = raymap.seams == SeamPlacement::kPlaced ? "placed" : "fixed";
  words["codec"] = look.codec ? std::string(name_of(*look.codec)) : "auto";
  words["quality"] = look.quality;
  words["preset"] = look.preset;
  words["container"] = static_cast<int>(look.container);
  words["preview"] = look.preview;
}

const PlannedSeams* FilmPlan::seams_at(std::uint64_t segment) const {
  const PlannedSeams* found = nullptr;
  for (const PlannedSeams& some : seams) {
    if (some.segment <= segment) found = &some;
  }
  return found;
}

Result<FilmPlan> make_plan(const FilmRequest& request, const std::vector<FilmFile>& films, const Programs& programs,
                           std::vector<std::string>& notes) {
  FilmPlan plan;
  NODAL_TRY_ASSIGN(plan.request, words_of(request, programs));
  plan.calibration = request.calibration;
  plan.raymap = request.raymap;
  plan.raymap.format = raymap_format(films);
  plan.container = request.container;
  std::vector<HeadTime> times;
  for (const HeadCalibration& head : request.calibration.heads) times.push_back({head.name, 0, 0});
  for (const HeadTime& wanted : request.times) {
    const auto head = std::ranges::find(times, wanted.head, &HeadTime::head);
    if (head == times.end()) {
      return fail(Errc::kBadValue, fmt::format("--offset {}: the calibration has no head of this name", wanted.head));
    }
    *head = wanted;
  }
  plan.coding = {request.codec.value_or(usual_codec(request.container, plan.raymap.width)),
                 plan.raymap.width,
                 plan.raymap.height,
                 plan.raymap.format,
                 usual_rate(*films.front().rate),
                 request.quality,
                 request.preset,
                 films.front().transfer};
  for (std::size_t h = 0; h < films.size(); ++h) {
    for (const std::string& note : films[h].notes) notes.push_back(fmt::format("{}: {}", films[h].path, note));
    plan.heads.push_back({times[h].head, films[h], {}, 0, times[h]});
    plan.heads.back().film.times.resize(1);
    plan.heads.back().film.notes.clear();
  }
  NODAL_TRY_ASSIGN(const FilmSpan span, chosen_span(films, times, request.preview, plan.coding.rate));
  NODAL_TRY(check(plan.coding, request.container, programs));
  NODAL_TRY(choose_frames(plan, films, times, span, notes));
  NODAL_TRY_ASSIGN(plan.sound, choose_sound(request, films, times, span, programs));
  const bool copied = sound_is_copied(plan) && plan.container != Container::kMkv;
  if (plan.sound && !copied && !ambisonic_of(plan.sound->path).empty()) {
    notes.push_back(fmt::format(
        "{}: its sound is ambisonic; {}, so that the film does not say it and players take it for loudspeakers' "
        "channels",
        plan.sound->path,
        plan.container == Container::kMkv ? "Matroska has no place to say so"
                                          : "it is coded again, because its clock or its codec does not fit the film"));
  }
  return plan;
}

}  // namespace nodal::film
