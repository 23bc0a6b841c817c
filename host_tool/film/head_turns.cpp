#include "host_tool/film/head_turns.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <optional>

#include "host_tool/child/child.h"
#include "host_tool/film/head_film.h"
#include "host_tool/film/nut_reader.h"
#include "protocol/base/try.h"
#include "stitch/media/gpmf/gyro.h"
#include "stitch/motion/head_motion.h"

namespace nodal::film {
namespace {

constexpr int kSmallSide = 160;                   // px: the longer side
constexpr std::size_t kMaxBands = 64;             // bands of rows in which flashes are looked for
constexpr std::size_t kMaxTelemetry = 128 << 20;  // bytes; GoPro writes 10 to 20 kB a second

/// The words of a decoder of small grey pictures, from `from_s` after the file's start on.
std::vector<std::string> small_words(const FilmFile& film, int width, int height, double from_s) {
  std::vector<std::string> words{"-hide_banner",  "-nostats", "-v",       "error", "-nostdin",
                                 "-noautorotate", "-copyts",  "-threads", "2"};
  const std::vector<std::string> rules = input_rules(film.path);
  words.insert(words.end(), rules.begin(), rules.end());
  if (from_s > 0) words.insert(words.end(), {"-ss", fmt::format("{:.6f}", from_s)});
  words.insert(words.end(),
               {"-i", file_url(film.path), "-map", fmt::format("0:V:{}", film.track), "-vf",
                filters_of(film, fmt::format("scale={}:{}:flags=area", width, height)), "-fps_mode", "passthrough",
                "-enc_time_base", fmt::format("{}/{}", film.time_base.num, film.time_base.den), "-c:v", "rawvideo",
                "-pix_fmt", "gray", "-f", "nut", "pipe:1"});
  return words;
}

/// Gathers what the pictures between two times tell.
class Watch {
 public:
  Watch(const FilmFile& film, motion::HeadMotion& motion, int width, int height, double readout_s, SeenMotion& seen)
      : film_(film), motion_(motion), width_(width), height_(height), seen_(seen) {
    seen_.brightness.readout = readout_s;
    seen_.brightness.rows = readout_s > 0 ? static_cast<int>(std::min(kMaxBands, static_cast<std::size_t>(height))) : 1;
  }

  Status run(const Programs& programs, double from_s, double to_s, const std::function<bool(double)>& go_on) {
    const double first = seconds_of(film_.times.front(), film_.time_base);
    const auto decoder = Child::start(
        {.program = programs.ffmpeg,
         .arguments = small_words(film_, width_, height_, from_s > 0 ? first + from_s - film_.file_starts_s : 0),
         .output = true,
         .memory = decoder_memory(film_)});
    if (!decoder) return fail(decoder.error().in(film_.path));
    NutReader nut([&](std::span<std::uint8_t> into) { return (*decoder)->read(into); });
    const Status read = read_frames(nut, from_s, to_s, go_on);
    if (read || read.error().code == Errc::kCancelled) return read;
    const Child::End end = (*decoder)->wait();
    const std::string complaint = (*decoder)->complaint();
    return fail(Errc::kBadFormat, fmt::format("{}: it cannot be decoded: {}", film_.path,
                                              end.good() ? read.error().message : "ffmpeg " + end_of(end, complaint)));
  }

 private:
  Status read_frames(NutReader& nut, double from_s, double to_s, const std::function<bool(double)>& go_on) {
    NODAL_TRY_ASSIGN(const NutVideo video, nut.begin());
    std::vector<std::uint8_t> grey(static_cast<std::size_t>(width_) * static_cast<std::size_t>(height_));
    std::optional<double> before;
    for (;;) {
      NODAL_TRY_ASSIGN(const auto units, nut.next(grey));
      if (!units) return {};
      const double time = seconds_of(*units, video.time_base) - seconds_of(film_.times.front(), film_.time_base);
      if (time < from_s || (!seen_.brightness.times.empty() && time <= seen_.brightness.times.back())) continue;
      if (time > to_s) return {};
      if (!go_on((time - from_s) / (to_s - from_s))) return fail(Errc::kCancelled, "stopped");
      const auto angle = motion_.add(grey);
      if (angle && before) {
        seen_.rotation.times.push_back((*before + time) / 2);
        seen_.rotation.speeds.push_back(*angle / (time - *before));
      }
      before = time;
      add_brightness(time, grey);
    }
  }

  void add_brightness(double time, const std::vector<std::uint8_t>& grey) {
    seen_.brightness.times.push_back(time);
    const int bands = seen_.brightness.rows;
    for (int band = 0; band < bands; ++band) {
      const int begin = band * height_ / bands, end = (band + 1) * height_ / bands;
      double sum = 0;
      for (int at = begin * width_; at < end * width_; ++at) sum += grey[static_cast<std::size_t>(at)];
      seen_.brightness.luma.push_back(sum / (1.0 * (end - begin) * width_));
    }
  }

  const FilmFile& film_;
  motion::HeadMotion& motion_;
  int width_, height_;
  SeenMotion& seen_;
};

/// "1.001000,1.001000,6412": a payload's time, duration and size.
std::optional<std::array<double, 3>> numbers_of(std::string_view line) {
  std::array<double, 3> numbers{};
  for (double& number : numbers) {
    const auto [end, error] = std::from_chars(line.data(), line.data() + line.size(), number);
    if (error != std::errc() || !std::isfinite(number)) return std::nullopt;
    line.remove_prefix(static_cast<std::size_t>(end - line.data()));
    if (line.starts_with(',')) line.remove_prefix(1);
  }
  return numbers;
}

Result<std::string> answer(const std::string& program, const FilmFile& film, std::vector<std::string> before,
                           const std::vector<std::string>& after, std::size_t limit) {
  const std::vector<std::string> rules = input_rules(film.path);
  before.insert(before.end(), rules.begin(), rules.end());
  before.insert(before.end(), {"-i", file_url(film.path)});
  before.insert(before.end(), after.begin(), after.end());
  NODAL_TRY_ASSIGN(const auto child, Child::start({.program = program, .arguments = before, .output = true}));
  NODAL_TRY_ASSIGN(std::string text, child->read_all(limit));
  if (const Child::End end = child->wait(); !end.good()) {
    return fail(Errc::kBadFormat, fmt::format("its telemetry cannot be read: {}", end_of(end, child->complaint())));
  }
  return text;
}

Result<timing::Rotation> read_gyro_of(const Programs& programs, const FilmFile& film) {
  const std::string stream = fmt::format("{}", *film.gpmf);
  NODAL_TRY_ASSIGN(const std::string packets, answer(programs.ffprobe, film,
                                                     {"-v", "error", "-select_streams", stream, "-show_entries",
                                                      "packet=pts_time,duration_time,size", "-of", "csv=p=0"},
                                                     {}, kMaxTelemetry));
  NODAL_TRY_ASSIGN(const std::string bytes,
                   answer(programs.ffmpeg, film, {"-hide_banner", "-nostats", "-v", "error", "-nostdin"},
                          {"-map", "0:" + stream, "-c", "copy", "-f", "data", "pipe:1"}, kMaxTelemetry));
  const double first = seconds_of(film.times.front(), film.time_base);
  std::vector<media::TimedPayload> payloads;
  std::size_t at = 0;
  for (std::string_view rest = packets; !rest.empty();) {
    const std::string_view line = rest.substr(0, rest.find('\n'));
    rest.remove_prefix(std::min(rest.size(), line.size() + 1));
    const auto numbers = numbers_of(line);
    if (!numbers) continue;
    const auto [time, duration, size] = *numbers;
    if (!(size >= 0) || !(size <= static_cast<double>(bytes.size() - at))) {
      return fail(Errc::kTruncated, "its telemetry is shorter than it says");
    }
    const auto count = static_cast<std::size_t>(size);
    payloads.push_back(
        {time - first, duration, std::span(reinterpret_cast<const std::uint8_t*>(bytes.data()) + at, count)});
    at += count;
  }
  NODAL_TRY_ASSIGN(media::Gyro gyro, media::read_gyro(payloads));
  return timing::Rotation{std::move(gyro.times), std::move(gyro.speeds)};
}

}  // namespace

Result<SeenMotion> motion_of(const Programs& programs, const FilmFile& film, const HeadCalibration& head,
                             double readout_s, const std::function<bool(double)>& go_on) {
  const int longer = std::max(head.width, head.height), side = std::min(kSmallSide, longer);
  const int width = std::max(1, head.width * side / longer), height = std::max(1, head.height * side / longer);
  auto motion = motion::HeadMotion::make(head, width, height);
  if (!motion) return fail(motion.error().in(film.path));
  SeenMotion seen;
  Watch watch(film, *motion, width, height, readout_s, seen);
  const double end = film.seconds(film.times.size() - 1);
  if (end <= kWholeSeconds) {
    NODAL_TRY(watch.run(programs, 0, end, go_on));
    return seen;
  }
  NODAL_TRY(watch.run(programs, 0, kWholeSeconds / 2, [&](double part) { return go_on(part / 2); }));
  NODAL_TRY(watch.run(programs, end - kWholeSeconds / 2, end, [&](double part) { return go_on(0.5 + part / 2); }));
  return seen;
}

Result<timing::Rotation> gyro_of(const Programs& programs, const FilmFile& film) {
  auto gyro = read_gyro_of(programs, film);
  if (!gyro) return fail(gyro.error().in(film.path));
  return gyro;
}

}  // namespace nodal::film
