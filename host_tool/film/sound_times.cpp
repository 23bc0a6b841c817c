#include "host_tool/film/sound_times.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <span>

#include "host_tool/film/child.h"
#include "host_tool/film/programs.h"
#include "protocol/base/try.h"
#include "stitch/timing/film_times.h"
#include "stitch/timing/sound_lag.h"
#include "stitch/timing/sound_track.h"

namespace nodal::film {
namespace {

constexpr double kPerPpm = 1e6;    // millionths of one
constexpr double kReach = 60;      // s; cameras that people start one by one. More costs time, and finds more by chance
constexpr double kDecoding = 0.7;  // part of the time that decoding takes; the rest compares

bool is_given(const std::vector<HeadTime>& given, const std::string& head) {
  return std::ranges::find(given, head, &HeadTime::head) != given.end();
}

/// Reads 32-bit floats of this machine's order from ffmpeg.
Status add_samples(Child& decoder, timing::SoundReducer& reducer, const std::function<bool()>& go_on) {
  std::vector<std::uint8_t> bytes(1 << 18);
  std::vector<double> samples;
  std::size_t have = 0;
  for (;;) {
    NODAL_TRY_ASSIGN(const std::size_t count, decoder.read(std::span(bytes).subspan(have)));
    if (count == 0) return {};
    have += count;
    const std::size_t whole = have / sizeof(float);
    samples.clear();
    for (std::size_t n = 0; n < whole; ++n) {
      float sample = 0;
      std::memcpy(&sample, bytes.data() + n * sizeof sample, sizeof sample);
      samples.push_back(double{sample});
    }
    reducer.add(samples);
    std::copy(bytes.begin() + static_cast<std::ptrdiff_t>(whole * sizeof(float)),
              bytes.begin() + static_cast<std::ptrdiff_t>(have), bytes.begin());
    have -= whole * sizeof(float);
    if (!go_on()) return fail(Errc::kCancelled, "stopped");
  }
}

/// The film's sound; its times are seconds after the film's first frame.
Result<timing::SoundTrack> track_of(const Programs& programs, const FilmFile& film,
                                    const std::function<bool()>& go_on) {
  Result<timing::SoundReducer> reducer = timing::SoundReducer::make(film.sound->rate);
  if (!reducer) return fail(reducer.error().in(film.path));
  std::vector<std::string> words{"-hide_banner", "-nostats", "-v", "error", "-nostdin"};
  const std::vector<std::string> rules = input_rules();
  words.insert(words.end(), rules.begin(), rules.end());
  words.insert(words.end(), {"-i", file_url(film.path), "-map", "0:a:0", "-ac", "1", "-ar",
                             fmt::format("{}", film.sound->rate), "-c:a", "pcm_f32le", "-f", "f32le", "pipe:1"});
  auto decoder = Child::start({.program = programs.ffmpeg, .arguments = words, .output = true});
  if (!decoder) return fail(decoder.error().in(film.path));
  NODAL_TRY(add_samples(**decoder, *reducer, go_on));
  if (const Child::End end = (*decoder)->wait(); !end.good()) {
    return fail(Errc::kBadFormat, fmt::format("{}: its sound cannot be decoded: ffmpeg {}", film.path,
                                              end_of(end, (*decoder)->complaint())));
  }
  return std::move(*reducer).finish(film.sound->starts_s - seconds_of(film.times.front(), film.time_base));
}

}  // namespace

bool have_sound(const std::vector<FilmFile>& films, const std::vector<std::string>& heads,
                const std::vector<HeadTime>& given) {
  for (std::size_t h = 0; h < films.size(); ++h) {
    if (!films[h].sound && (h == 0 || !is_given(given, heads[h]))) return false;
  }
  return true;
}

Result<std::vector<HeadTime>> times_by_sound(const Programs& programs, const std::vector<FilmFile>& films,
                                             const std::vector<std::string>& heads, const std::vector<HeadTime>& given,
                                             std::vector<std::string>& notes,
                                             const std::function<bool(double)>& go_on) {
  std::vector<std::size_t> asked;  // the first head, against which times are, and all whose time is not given
  for (std::size_t h = 0; h < films.size(); ++h) {
    if (h == 0 || !is_given(given, heads[h])) asked.push_back(h);
  }
  std::vector<HeadTime> times = given;
  if (asked.size() < 2) return times;
  std::vector<timing::SoundTrack> tracks;
  std::vector<timing::HeadFilm> known;
  for (const std::size_t h : asked) {
    const double done = kDecoding * static_cast<double>(tracks.size()) / static_cast<double>(asked.size());
    NODAL_TRY_ASSIGN(timing::SoundTrack track, track_of(programs, films[h], [&] { return go_on(done); }));
    tracks.push_back(std::move(track));
    known.push_back({.name = heads[h], .start = 0, .end = films[h].seconds(films[h].times.size() - 1)});
  }
  std::vector<timing::PairLag> lags;
  std::vector<timing::NoLag> missing;
  const double pairs = static_cast<double>(asked.size() * (asked.size() - 1)) / 2;
  for (int a = 0; a < static_cast<int>(asked.size()); ++a) {
    for (int b = a + 1; b < static_cast<int>(asked.size()); ++b) {
      const double compared = static_cast<double>(lags.size() + missing.size());
      if (!go_on(kDecoding + (1 - kDecoding) * compared / pairs)) return fail(Errc::kCancelled, "stopped");
      const timing::SoundTrack &first = tracks[static_cast<std::size_t>(a)],
                               &second = tracks[static_cast<std::size_t>(b)];
      const timing::Search search{.expected = 0, .reach = std::min(kReach, std::max(first.end(), second.end()))};
      const Result<timing::Lag> lag = timing::sound_lag(first, second, search);
      if (lag) lags.push_back({a, b, timing::Source::kSound, *lag});
      else missing.push_back({a, b, timing::Source::kSound, lag.error().message});
    }
  }
  NODAL_TRY_ASSIGN(const timing::FilmTimes found, timing::film_times(known, lags, missing, {}));
  notes.insert(notes.end(), found.notes.begin(), found.notes.end());
  for (std::size_t k = 1; k < asked.size(); ++k) {
    // The first head's time = offset + clock * time of the head.
    const timing::HeadTime& head = found.heads[k];
    const double clock = 1 + head.ppm / kPerPpm;
    times.push_back({heads[asked[k]], -head.offset / clock, kPerPpm * (1 / clock - 1)});
    notes.push_back(fmt::format("head '{}': {:+.4f} s, {:+.1f} ppm against '{}', ± {:.1f} ms, by {}", heads[asked[k]],
                                times.back().offset_s, times.back().ppm, heads.front(), 1000 * head.sigma,
                                head.sources));
  }
  return times;
}

}  // namespace nodal::film
