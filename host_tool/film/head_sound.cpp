#include "host_tool/film/head_sound.h"

#include <fmt/format.h>

#include <cstring>
#include <span>
#include <utility>

#include "host_tool/child/child.h"
#include "protocol/base/try.h"

namespace nodal::film {
namespace {

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
    NODAL_TRY(reducer.add(samples));
    std::copy(bytes.begin() + static_cast<std::ptrdiff_t>(whole * sizeof(float)),
              bytes.begin() + static_cast<std::ptrdiff_t>(have), bytes.begin());
    have -= whole * sizeof(float);
    if (!go_on()) return fail(Errc::kCancelled, "stopped");
  }
}

}  // namespace

Result<timing::SoundTrack> track_of(const Programs& programs, const FilmFile& film,
                                    std::shared_ptr<timing::SoundStore> store, const std::function<bool()>& go_on) {
  Result<timing::SoundReducer> reducer = timing::SoundReducer::make(film.sound->rate, std::move(store));
  if (!reducer) return fail(reducer.error().in(film.path));
  std::vector<std::string> words{"-hide_banner", "-nostats", "-v", "error", "-nostdin"};
  const std::vector<std::string> rules = input_rules(film.path);
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

}  // namespace nodal::film
