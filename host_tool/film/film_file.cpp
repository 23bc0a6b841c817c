#include "host_tool/film/film_file.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <string_view>

#include "host_tool/child/child.h"
#include "host_tool/film/film_json.h"
#include "host_tool/film/film_list.h"
#include "protocol/base/file_ending.h"
#include "protocol/base/text.h"
#include "protocol/base/try.h"

namespace nodal::film {
namespace {

constexpr std::size_t kMaxStreams = std::size_t{1} << 20;  // ffprobe's words on a file's streams
constexpr std::size_t kMaxPackets = std::size_t{256} << 20;
constexpr std::size_t kMaxFrames = 10'000'000;  // 92 hours at 30 frames a second
constexpr int kMaxSide = 16384, kMaxTracks = 1000;

std::string text_of(const Json& object, const char* key) {
  const auto at = object.find(key);
  return at != object.end() && at->is_string() ? printable(at->get_ref<const std::string&>(), 100) : "";
}

std::int64_t number_of(const Json& object, const char* key) {
  const auto at = object.find(key);
  if (at == object.end()) return 0;
  if (at->is_number_integer()) return at->get<std::int64_t>();
  std::int64_t value = 0;
  if (!at->is_string()) return 0;
  const auto& text = at->get_ref<const std::string&>();
  std::from_chars(text.data(), text.data() + text.size(), value);
  return value;
}

Rational fraction_of(const std::string& text, char between) {
  Rational fraction{0, 0};
  const char* const end = text.data() + text.size();
  const auto [at, error] = std::from_chars(text.data(), end, fraction.num);
  if (error == std::errc() && at != end && *at == between) std::from_chars(at + 1, end, fraction.den);
  return fraction;
}

struct Decoding {
  std::string_view coded;
  PixelFormat format;
  std::string_view decoded;
  bool full_range = false;
};
/// Formats that the blend reads as they are coded, and the nearest one for others.
constexpr std::array kDecodings{Decoding{"yuv420p", PixelFormat::kI420, "yuv420p"},
                                Decoding{"yuvj420p", PixelFormat::kI420, "yuvj420p", true},
                                Decoding{"nv12", PixelFormat::kNv12, "nv12"},
                                Decoding{"yuv422p", PixelFormat::kI422, "yuv422p"},
                                Decoding{"yuvj422p", PixelFormat::kI422, "yuvj422p", true},
                                Decoding{"yuyv422", PixelFormat::kYuyv, "yuyv422"},
                                Decoding{"uyvy422", PixelFormat::kUyvy, "uyvy422"},
                                Decoding{"gray", PixelFormat::kGrey8, "gray", true},
                                Decoding{"rgb24", PixelFormat::kRgb24, "rgb24", true},
                                Decoding{"bgr24", PixelFormat::kRgb24, "rgb24", true},
                                Decoding{"bgr0", PixelFormat::kRgb24, "rgb24", true},
                                Decoding{"rgb0", PixelFormat::kRgb24, "rgb24", true},
                                Decoding{"rgba", PixelFormat::kRgb24, "rgb24", true},
                                Decoding{"bgra", PixelFormat::kRgb24, "rgb24", true},
                                Decoding{"gbrp", PixelFormat::kRgb24, "rgb24", true}};

void choose_format(FilmFile& film, const Json& stream) {
  const std::string range = text_of(stream, "color_range"), matrix = text_of(stream, "color_space");
  film.coding.video_range = range != "pc";
  constexpr int kHd = 720;  // without a word, pictures from this height on are BT.709 (ITU-R BT.709-6)
  film.coding.bt709 = matrix == "bt709" || (matrix.empty() || matrix == "unknown" ? film.height >= kHd : false);
  const auto* const known = std::ranges::find(kDecodings, film.coded_format, &Decoding::coded);
  if (known != kDecodings.end()) {
    film.format = known->format;
    film.decoded_format = known->decoded;
    if (known->full_range) film.coding.video_range = false;
    return;
  }
  film.format = PixelFormat::kI420;
  film.decoded_format = "yuv420p";
  film.notes.push_back(fmt::format("its pixel format is {}; it is converted to 8 bits with half the chroma (yuv420p)",
                                   film.coded_format));
}

void read_rotation(FilmFile& film, const Json& stream) {
  const auto list = stream.find("side_data_list");
  if (list == stream.end() || !list->is_array()) return;
  for (const Json& data : *list) {
    if (!data.is_object() || data.find("rotation") == data.end()) continue;
    film.rotation_deg = static_cast<int>(number_of(data, "rotation"));
  }
  if (film.rotation_deg == 0) return;
  film.notes.push_back(
      fmt::format("it has a rotation tag of {} degrees, which is not applied: calibrate the head with "
                  "pictures as they are coded (ffmpeg -noautorotate)",
                  film.rotation_deg));
}

Status read_video(FilmFile& film, const Json& stream) {
  film.width = static_cast<int>(std::clamp<std::int64_t>(number_of(stream, "width"), 0, kMaxSide + 1));
  film.height = static_cast<int>(std::clamp<std::int64_t>(number_of(stream, "height"), 0, kMaxSide + 1));
  if (film.width == 0 || film.height == 0) return fail(Errc::kBadFormat, "the size of its pictures is not known");
  if (film.width > kMaxSide || film.height > kMaxSide) {
    return fail(Errc::kTooLarge, fmt::format("its pictures have a side over {} px", kMaxSide));
  }
  film.coded_format = text_of(stream, "pix_fmt");
  if (film.coded_format.empty() || film.coded_format == "unknown") {
    return fail(Errc::kUnsupported, fmt::format("ffmpeg cannot decode its video ({})", text_of(stream, "codec_name")));
  }
  film.transfer = text_of(stream, "color_transfer");
  if (film.transfer == "arib-std-b67" || film.transfer == "smpte2084") {
    return fail(Errc::kUnsupported, fmt::format("its light is HDR ({}), which is not supported yet; convert it to SDR "
                                                "with ffmpeg's filters zscale and tonemap",
                                                film.transfer == "smpte2084" ? "PQ" : "HLG"));
  }
  choose_format(film, stream);
  read_rotation(film, stream);
  const std::string order = text_of(stream, "field_order");
  film.interlaced = !order.empty() && order != "progressive" && order != "unknown";
  if (film.interlaced) film.notes.emplace_back("it is interlaced; both fields of a frame are blended as one picture");
  for (const char* const key : {"avg_frame_rate", "r_frame_rate"}) {
    const Rational rate = fraction_of(text_of(stream, key), '/');
    if (film.rate || rate.num <= 0 || rate.den <= 0) continue;
    film.rate = FrameRate::make(static_cast<std::uint64_t>(rate.num), static_cast<std::uint64_t>(rate.den));
  }
  film.time_base = fraction_of(text_of(stream, "time_base"), '/');
  if (film.time_base.num <= 0 || film.time_base.den <= 0) return fail(Errc::kBadFormat, "it has no unit of time");
  film.announced = static_cast<std::uint64_t>(std::max<std::int64_t>(0, number_of(stream, "nb_frames")));
  return {};
}

double start_of(const Json& object) {
  double start = 0;
  const std::string text = text_of(object, "start_time");
  std::from_chars(text.data(), text.data() + text.size(), start);
  return std::isfinite(start) ? start : 0;
}

void read_sound(FilmFile& film, const Json& stream) {
  const std::string codec = text_of(stream, "codec_name");
  if (film.sound || codec.empty() || codec == "unknown" || codec == "none") return;
  film.sound = FilmSound{codec, static_cast<int>(number_of(stream, "sample_rate")), start_of(stream)};
}

/// "2026-11-28T14:03:09.000000Z" in seconds.
std::optional<double> date_of(const std::string& text) {
  int year = 0, month = 0, day = 0, hour = 0, minute = 0;
  double second = 0;
  if (std::sscanf(text.c_str(), "%4d-%2d-%2dT%2d:%2d:%9lf", &year, &month, &day, &hour, &minute, &second) != 6) {
    return std::nullopt;
  }
  const std::chrono::year_month_day date{std::chrono::year(year), std::chrono::month(static_cast<unsigned>(month)),
                                         std::chrono::day(static_cast<unsigned>(day))};
  constexpr int kFirstYear = 1980;  // 1904 and 1970 are what clocks that were never set say
  if (!date.ok() || year < kFirstYear || !(second >= 0)) return std::nullopt;
  const auto days = std::chrono::sys_days(date).time_since_epoch().count();
  return 86400.0 * static_cast<double>(days) + 3600.0 * hour + 60.0 * minute + second;
}

/// Lines like "3003,K__": a time, and flags, of which D says that an edit list leaves the frame out.
Status read_times(FilmFile& film, std::string_view packets) {
  std::size_t without = 0;
  while (!packets.empty()) {
    std::string_view line = packets.substr(0, packets.find('\n'));
    packets.remove_prefix(std::min(packets.size(), line.size() + 1));
    if (line.empty() || line.find('D') != std::string_view::npos) continue;
    std::int64_t time = 0;
    const auto [end, error] = std::from_chars(line.data(), line.data() + line.size(), time);
    if (error != std::errc() || std::abs(time) > INT64_MAX / 4) ++without;
    else film.times.push_back(time);
    if (film.times.size() > kMaxFrames) return fail(Errc::kTooLarge, fmt::format("it has over {} frames", kMaxFrames));
  }
  if (film.times.empty() && without == 0) return fail(Errc::kTruncated, "it has no frames");
  if (without > film.times.size() / 10) {
    return fail(Errc::kBadFormat,
                "its frames have no times; put it into a container that has them: ffmpeg -r RATE -i "
                "FILE -c copy FILE.mp4");
  }
  std::ranges::sort(film.times);
  film.times.erase(std::ranges::unique(film.times).begin(), film.times.end());
  if (film.announced > film.times.size() + film.times.size() / 50) {
    film.notes.push_back(
        fmt::format("it is cut: it has {} of the {} frames that it announces", film.times.size(), film.announced));
  }
  if (!film.rate && film.times.size() > 1) {
    const double period = film.seconds(film.times.size() - 1) / static_cast<double>(film.times.size() - 1);
    if (period > 0) film.rate = FrameRate::make(static_cast<std::uint64_t>(std::llround(1000 / period)), 1000);
  }
  if (!film.rate) return fail(Errc::kBadFormat, "its frame rate is not known");
  return {};
}

Result<std::string> ask(const Programs& programs, const std::string& path, std::vector<std::string> what,
                        std::size_t limit) {
  std::vector<std::string> words{"-v", "error"};
  const std::vector<std::string> rules = input_rules(path);
  words.insert(words.end(), rules.begin(), rules.end());
  words.insert(words.end(), what.begin(), what.end());
  words.push_back(file_url(path));
  NODAL_TRY_ASSIGN(const auto child,
                   Child::start({.program = programs.ffprobe, .arguments = std::move(words), .output = true}));
  NODAL_TRY_ASSIGN(std::string text, child->read_all(limit));
  const Child::End end = child->wait();
  if (end.good()) return text;
  const std::string complaint = child->complaint();
  if (complaint.find("moov atom not found") != std::string::npos) {
    return fail(Errc::kTruncated,
                "the recording was not finished: its index (moov) is missing. The camera, or a tool "
                "like untrunc, may repair it");
  }
  if (complaint.find("ormat not on whitelist") != std::string::npos) {
    return fail(Errc::kUnsupported, "it is no film but a list or script that names other files; name the films");
  }
  return fail(Errc::kBadFormat, fmt::format("it cannot be read as a film: ffprobe {}", end_of(end, complaint)));
}

}  // namespace

Result<FilmFile> film_of(const std::string& streams_json, const std::string& packets_csv, int track) {
  FilmFile film;
  const Json document = Json::parse(streams_json, nullptr, false);
  const auto streams = document.is_object() ? document.find("streams") : document.end();
  if (!document.is_object() || streams == document.end() || !streams->is_array()) {
    return fail(Errc::kBadFormat, "ffprobe's answer is not understood");
  }
  film.track = track;
  film.tracks = 0;
  for (const Json& stream : *streams) {
    if (!stream.is_object()) continue;
    const std::string kind = text_of(stream, "codec_type");
    const auto disposition = stream.find("disposition");
    const bool cover =
        disposition != stream.end() && disposition->is_object() && number_of(*disposition, "attached_pic") != 0;
    if (kind == "audio") read_sound(film, stream);
    if (kind == "data" && text_of(stream, "codec_tag_string") == "gpmd" && !film.gpmf) {
      film.gpmf = static_cast<int>(std::clamp<std::int64_t>(number_of(stream, "index"), 0, kMaxTracks));
    }
    if (kind != "video" || cover || film.tracks++ != track) continue;
    NODAL_TRY(read_video(film, stream));
  }
  if (film.tracks == 0) return fail(Errc::kBadFormat, "it has no pictures");
  if (film.tracks <= track) {
    return fail(Errc::kBadFormat,
                fmt::format("it has {} of pictures, and head {} wants another one",
                            film.tracks == 1 ? "1 track" : fmt::format("{} tracks", film.tracks), track + 1));
  }
  const auto format = document.find("format");
  if (format != document.end() && format->is_object()) {
    film.file_starts_s = start_of(*format);
    const auto tags = format->find("tags");
    if (tags != format->end() && tags->is_object()) film.created_s = date_of(text_of(*tags, "creation_time"));
  }
  NODAL_TRY(read_times(film, packets_csv));
  return film;
}

Result<FilmFile> probe(const Programs& programs, const std::string& path, int track) {
  std::error_code error;
  if (!std::filesystem::exists(path, error))
    return fail(Errc::kNotFound, fmt::format("{}: there is no such file", path));
  if (!std::filesystem::is_regular_file(path, error))
    return fail(Errc::kBadFormat, fmt::format("{}: it is no file", path));
  const auto streams = ask(programs, path, {"-show_streams", "-show_format", "-of", "json"}, kMaxStreams);
  if (!streams) return fail(streams.error().in(path));
  const auto packets =
      ask(programs, path,
          {"-select_streams", fmt::format("V:{}", track), "-show_entries", "packet=pts,flags", "-of", "csv=p=0"},
          kMaxPackets);
  if (!packets) return fail(packets.error().in(path));
  auto film = film_of(*streams, *packets, track);
  if (!film) return fail(film.error().in(path));
  film->path = path;
  if (is_list(path)) film->gpmf.reset();  // telemetry is not read across files
  film->bytes = std::filesystem::file_size(path, error);
  return film;
}

Result<FilmSound> probe_sound(const Programs& programs, const std::string& path) {
  const auto streams = ask(programs, path, {"-show_streams", "-of", "json"}, kMaxStreams);
  if (!streams) return fail(streams.error().in(path));
  FilmFile file;
  const Json document = Json::parse(*streams, nullptr, false);
  if (document.is_object() && document.contains("streams") && document["streams"].is_array()) {
    for (const Json& stream : document["streams"]) {
      if (stream.is_object() && text_of(stream, "codec_type") == "audio") read_sound(file, stream);
    }
  }
  if (!file.sound) return fail(Errc::kBadFormat, fmt::format("{}: it has no sound", path));
  return *file.sound;
}

FilmFile part_of(FilmFile film, int columns, int rows, int n) {
  constexpr int kEven = ~1;
  film.width = (film.width / columns) & kEven;
  film.height = (film.height / rows) & kEven;
  film.place = FilmFile::Place{n % columns * film.width, n / columns * film.height};
  return film;
}

std::string filters_of(const FilmFile& film, const std::string& next) {
  if (!film.place) return next;
  const std::string crop =
      fmt::format("crop={}:{}:{}:{}:exact=1", film.width, film.height, film.place->left, film.place->top);
  return next.empty() ? crop : crop + "," + next;
}

bool is_film_name(std::string_view path) {
  constexpr std::array<std::string_view, 20> kEndings{".mp4", ".mov",  ".mkv", ".avi",  ".m4v", ".mts",  ".m2ts",
                                                      ".ts",  ".webm", ".mpg", ".mpeg", ".mxf", ".insv", ".360",
                                                      ".lrv", ".3gp",  ".nut", ".wmv",  ".ogv", ".m2v"};
  return std::ranges::any_of(kEndings, [&](std::string_view ending) { return has_ending(path, ending); });
}

}  // namespace nodal::film
