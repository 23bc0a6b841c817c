#include "host_tool/film/still_moments.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <utility>

#include "host_tool/child/child.h"
#include "host_tool/film/film_time.h"
#include "host_tool/film/head_film.h"
#include "protocol/base/try.h"

namespace nodal::film {
namespace {

constexpr int kSmallSide = 320;                          // px: the longer side
constexpr double kMotionCounts = 2;                      // motion of half the detail makes it worth nothing
constexpr std::size_t kMaxPng = std::size_t{512} << 20;  // bytes

/// What ffmpeg makes of some frames from one on, as `words` say.
Result<std::string> decoded(const Programs& programs, const FilmFile& film, std::size_t frame,
                            const std::vector<std::string>& words, std::size_t limit) {
  std::vector<std::string> all{"-hide_banner", "-nostats", "-v", "error", "-nostdin", "-noautorotate", "-threads", "2"};
  const std::vector<std::string> rules = input_rules(film.path);
  all.insert(all.end(), rules.begin(), rules.end());
  if (frame > 0) {
    // Between the frame and the one before, so that rounding leads to neither of the others.
    const double between =
        (seconds_of(film.times[frame - 1], film.time_base) + seconds_of(film.times[frame], film.time_base)) / 2;
    all.insert(all.end(), {"-ss", fmt::format("{:.6f}", std::max(0.0, between - film.file_starts_s))});
  }
  all.insert(all.end(), {"-i", file_url(film.path), "-map", fmt::format("0:V:{}", film.track)});
  all.insert(all.end(), words.begin(), words.end());
  const auto child =
      Child::start({.program = programs.ffmpeg, .arguments = all, .output = true, .memory = decoder_memory(film)});
  if (!child) return fail(child.error().in(film.path));
  Result<std::string> bytes = (*child)->read_all(limit);
  const Child::End end = (*child)->wait();
  if (bytes && end.good() && !bytes->empty()) return bytes;
  const std::string why = !bytes ? bytes.error().message : "ffmpeg " + end_of(end, (*child)->complaint());
  return fail(Errc::kBadFormat, fmt::format("{}: frame {} cannot be decoded: {}", film.path, frame, why));
}

/// Detail of a small grey picture, and how much it differs from the next frame; levels.
struct Look {
  double detail = 0, change = 0;
};
Result<Look> look_at(const Programs& programs, const FilmFile& film, std::size_t frame) {
  const int longer = std::max(film.width, film.height), side = std::min(kSmallSide, longer);
  const int width = std::max(2, film.width * side / longer), height = std::max(2, film.height * side / longer);
  const auto size = static_cast<std::size_t>(width) * static_cast<std::size_t>(height);
  const std::size_t from = frame + 1 < film.times.size() || frame == 0 ? frame : frame - 1;
  NODAL_TRY_ASSIGN(
      const std::string bytes,
      decoded(programs, film, from,
              {"-vf", filters_of(film, fmt::format("scale={}:{}:flags=area,format=gray", width, height)), "-fps_mode",
               "passthrough", "-frames:v", "2", "-c:v", "rawvideo", "-f", "rawvideo", "pipe:1"},
              2 * size));
  if (bytes.size() % size != 0) return fail(Errc::kBadFormat, film.path + ": its pictures change their size");
  const auto level = [&](std::size_t at) { return static_cast<int>(static_cast<std::uint8_t>(bytes[at])); };
  std::int64_t detail = 0, change = 0;
  for (std::size_t at = 0; at < size; ++at) {
    if ((at + 1) % static_cast<std::size_t>(width) != 0) detail += std::abs(level(at + 1) - level(at));
    if (at + static_cast<std::size_t>(width) < size)
      detail += std::abs(level(at + static_cast<std::size_t>(width)) - level(at));
    if (bytes.size() == 2 * size) change += std::abs(level(at + size) - level(at));
  }
  const auto pixels = static_cast<double>(size);
  return Look{static_cast<double>(detail) / pixels, static_cast<double>(change) / pixels};
}

}  // namespace

Result<std::vector<Moment>> still_moments(const Programs& programs, const std::vector<FilmFile>& films,
                                          const std::vector<HeadTime>& times,
                                          const std::function<bool(double)>& go_on) {
  constexpr double kPeriod = 0.01;  // s, of instants to choose from
  NODAL_TRY_ASSIGN(const FilmSpan span, common_span(films, times, kPeriod));
  std::vector<Moment> moments;
  for (int k = 0; k < kMoments; ++k) {
    const auto instant = span.frames * static_cast<std::uint64_t>(2 * k + 1) / (2 * kMoments);
    const FilmSpan one{span.from_s + static_cast<double>(instant) * kPeriod, 1, ""};
    Moment moment;
    for (std::size_t h = 0; h < films.size(); ++h) {
      if (!go_on((k + static_cast<double>(h) / static_cast<double>(films.size())) / kMoments)) {
        return fail(Errc::kCancelled, "stopped");
      }
      double farthest = 0;
      moment.frames.push_back(nearest_frames(films[h], times[h], one, kPeriod, &farthest).front());
      NODAL_TRY_ASSIGN(const Look look, look_at(programs, films[h], moment.frames[h]));
      moment.detail += look.detail / static_cast<double>(films.size());
      moment.motion = std::max(moment.motion, look.detail > 0 ? look.change / look.detail : 0);
    }
    const bool again = std::ranges::any_of(moments, [&](const Moment& m) { return m.frames == moment.frames; });
    if (!again) moments.push_back(std::move(moment));
  }
  std::ranges::stable_sort(moments, std::greater(), [](const Moment& moment) {
    return moment.detail * (1 - std::min(1.0, kMotionCounts * moment.motion));
  });
  return moments;
}

Result<std::vector<std::uint8_t>> png_of(const Programs& programs, const FilmFile& film, std::size_t frame) {
  std::vector<std::string> words;
  if (film.place) words = {"-vf", filters_of(film)};
  words.insert(words.end(), {"-frames:v", "1", "-c:v", "png", "-pix_fmt", "rgb24", "-f", "image2pipe", "pipe:1"});
  NODAL_TRY_ASSIGN(const std::string bytes, decoded(programs, film, frame, words, kMaxPng));
  return std::vector<std::uint8_t>(bytes.begin(), bytes.end());
}

}  // namespace nodal::film
