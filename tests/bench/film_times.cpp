// Films of heads with clocks of their own, simulated by a seed: are the times that are accepted true, and are their
// claimed errors?
#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <map>
#include <random>
#include <string>
#include <vector>

#include "stitch/timing/film_times.h"
#include "stitch/timing/flash_lag.h"
#include "stitch/timing/rotation_lag.h"
#include "stitch/timing/sound_lag.h"
#include "tests/unit/stitch_timing/recordings.h"

namespace nodal::timing {
namespace {

using recordings::Clock;

constexpr int kSoundRate = 16000;

/// What a film is of, drawn by its seed.
struct Film {
  std::vector<Clock> clocks{};
  double seconds = 30;
  std::string sound{};               ///< kind of sound
  std::string motion{};              ///< kind of motion
  std::vector<SoundTrack> tracks{};  ///< a track without samples: no sound
  std::vector<Rotation> rotations{};
  std::vector<Brightness> brightness{};  ///< empty: no flashes
};

double drawn(std::mt19937& random, double low, double high) {
  return std::uniform_real_distribution<double>(low, high)(random);
}

recordings::Sound event_sound(const std::string& kind, double seconds, std::mt19937& random) {
  const double start = -6, length = seconds + 12;
  const auto seed = static_cast<std::uint32_t>(random());
  if (kind == "silence" || kind == "noise") return {start, std::vector<double>(10, 0.0)};
  if (kind == "hum") return recordings::hum(start, length);
  recordings::Sound sound = recordings::speech(start, length, seed);
  const auto add = [&](const recordings::Sound& other, double louder, double own) {
    for (std::size_t i = 0; i < sound.samples.size(); ++i) {
      sound.samples[i] = own * sound.samples[i] + louder * other.samples[i];
    }
  };
  if (kind == "speech in hum") add(recordings::hum(start, length), drawn(random, 0.5, 3), 1);
  if (kind == "music with a beat") add(recordings::loop_of(start, length, drawn(random, 0.4, 3), seed + 1), 0.5, 0);
  if (kind == "music and speech") add(recordings::loop_of(start, length, drawn(random, 0.4, 3), seed + 1), 0.5, 0.3);
  return sound;
}

Film drawn_film(std::uint32_t seed) {
  std::mt19937 random(seed);
  static const std::vector<std::string> kSounds{"speech",           "speech",  "speech in hum", "music with a beat",
                                                "music and speech", "silence", "hum",           "noise"};
  static const std::vector<std::string> kMotions{"shake", "shake", "still", "swing"};
  Film film;
  film.sound = kSounds[random() % kSounds.size()];
  film.motion = kMotions[random() % kMotions.size()];
  film.seconds = drawn(random, 20, 45);
  const auto heads = 2 + static_cast<int>(random() % 7);
  const auto with_sound = static_cast<int>(random() % static_cast<std::uint32_t>(heads + 1));
  const bool gyros = random() % 3 == 0;
  const bool all_sound = random() % 2 == 0;
  const auto sound = event_sound(film.sound, film.seconds, random);
  const double noise = drawn(random, 0.01, 0.3);
  recordings::Shake shake = recordings::Shake(static_cast<std::uint32_t>(random()));
  if (film.motion == "still") shake = recordings::Shake::still();
  if (film.motion == "swing") shake = recordings::Shake::swing(drawn(random, 0.5, 3));
  std::vector<double> flashes;
  if (random() % 4 == 0) {
    const auto count = 1 + random() % 6;
    for (std::size_t i = 0; i < count; ++i) flashes.push_back(drawn(random, 0, film.seconds));
  }
  for (int h = 0; h < heads; ++h) {
    const Clock clock{drawn(random, -3, 3), drawn(random, -100, 100)};
    film.clocks.push_back(clock);
    SoundTrack track;
    if (all_sound || h < with_sound) {
      // Sound needs up to 0.25 ms more or less to this microphone.
      const Clock heard{clock.offset + drawn(random, -0.25e-3, 0.25e-3), clock.ppm};
      const double own_noise = film.sound == "silence" ? 1e-6 : film.sound == "hum" ? 0.003 : noise;
      auto reducer = SoundReducer::make(kSoundRate);
      (void)reducer->add(recordings::recorded(sound, heard, kSoundRate, film.seconds, own_noise,
                                              static_cast<std::uint32_t>(random())));
      track = *std::move(*reducer).finish(0);
    }
    film.tracks.push_back(std::move(track));
    const double rates[] = {25, 30, 60};
    film.rotations.push_back(recordings::turned(shake, clock, gyros ? 200 : rates[random() % 3], film.seconds,
                                                gyros ? 0.01 : drawn(random, 0.005, 0.04),
                                                static_cast<std::uint32_t>(random())));
    if (!flashes.empty()) {
      const recordings::Camera camera{.rate = rates[random() % 2], .readout = drawn(random, 0.008, 0.025)};
      film.brightness.push_back(
          recordings::filmed(flashes, clock, camera, film.seconds, static_cast<std::uint32_t>(random())));
    }
  }
  return film;
}

struct Lags {
  std::vector<PairLag> found{};
  std::vector<NoLag> missing{};
  void add(int a, int b, Source source, const Result<Lag>& lag) {
    if (lag) found.push_back({a, b, source, *lag});
    else missing.push_back({a, b, source, lag.error().message});
  }
};

/// All pairs of up to four heads; of more, every head with the next two.
Lags lags_of(const Film& film, bool use_sound, bool use_rotation, bool use_flash) {
  Lags lags;
  const auto heads = static_cast<int>(film.clocks.size());
  for (int a = 0; a < heads; ++a) {
    for (int b = a + 1; b < heads; ++b) {
      if (heads > 4 && b - a > 2 && b - a < heads - 1) continue;
      const auto ia = static_cast<std::size_t>(a), ib = static_cast<std::size_t>(b);
      const bool heard = film.tracks[ia].count() > 0 && film.tracks[ib].count() > 0;
      if (use_sound && heard) lags.add(a, b, Source::kSound, sound_lag(film.tracks[ia], film.tracks[ib], {}));
      if (use_rotation) lags.add(a, b, Source::kRotation, rotation_lag(film.rotations[ia], film.rotations[ib], {}));
      if (use_flash && !film.brightness.empty()) {
        lags.add(a, b, Source::kFlash, flash_lag(film.brightness[ia], film.brightness[ib], {}));
      }
    }
  }
  return lags;
}

/// Errors of one kind of source over all films.
struct Errors {
  std::vector<double> times{};   ///< largest over the film, s
  std::vector<double> rates{};   ///< ppm
  std::vector<double> ratios{};  ///< error / claimed
  int wrong = 0;
};

double quantile(std::vector<double> values, double share) {
  if (values.empty()) return 0;
  std::ranges::sort(values);
  return values[std::min(values.size() - 1, static_cast<std::size_t>(share * static_cast<double>(values.size())))];
}

double share_below(const std::vector<double>& values, double limit) {
  const auto count = std::ranges::count_if(values, [&](double x) { return x < limit; });
  return values.empty() ? 0 : 100.0 * static_cast<double>(count) / static_cast<double>(values.size());
}

/// A time is wrong if it is off by more than `bound`, whatever was claimed.
void compare(const std::string& name, const Clock& truth, const Clock& reference, const HeadTime& head, double seconds,
             double bound, Errors& errors) {
  double largest = 0;
  for (const double at : {0.0, seconds / 2, seconds}) {
    const double expected = reference.head_time(truth.true_time(at));
    largest = std::max(largest, std::abs(head.offset + (1 + head.ppm * 1e-6) * at - expected));
  }
  const double ppm = ((1 + truth.ppm * 1e-6) / (1 + reference.ppm * 1e-6) - 1) * 1e6;
  errors.times.push_back(largest);
  errors.rates.push_back(std::abs(head.ppm - ppm));
  errors.ratios.push_back(largest / head.sigma);
  if (largest > bound) {
    ++errors.wrong;
    std::printf("WRONG: %s: off by %.3f ms, claimed %.3f ms, by %s\n", name.c_str(), largest * 1e3, head.sigma * 1e3,
                head.sources.c_str());
  }
}

void print(const std::string& name, const Errors& e) {
  std::printf("| %s | %zu | %.3f | %.3f | %.3f | %.2f | %.2f | %.0f | %.0f | %d |\n", name.c_str(), e.times.size(),
              quantile(e.times, 0.5) * 1e3, quantile(e.times, 0.95) * 1e3, quantile(e.times, 1) * 1e3,
              quantile(e.rates, 0.5), quantile(e.rates, 0.95), share_below(e.ratios, 1), share_below(e.ratios, 2),
              e.wrong);
}

int run(int films, int first, double bound) {
  std::map<std::string, Errors> by_source;
  std::map<std::string, int> accepted, refused;
  for (int i = first; i < first + films; ++i) {
    const Film film = drawn_film(static_cast<std::uint32_t>(i));
    std::vector<HeadFilm> heads;
    for (std::size_t h = 0; h < film.clocks.size(); ++h) {
      heads.push_back({"cam" + std::to_string(h), 0, film.seconds, std::nullopt});
    }
    const std::string kind = film.sound + ", " + film.motion + (film.brightness.empty() ? "" : ", flashes");
    for (const std::string source : {"sound alone", "rotation alone", "flash alone", "all sources"}) {
      const bool all = source == "all sources";
      const Lags lags = lags_of(film, all || source == "sound alone", all || source == "rotation alone",
                                all || source == "flash alone");
      const auto times = film_times(heads, lags.found, lags.missing, {});
      if (all)
        std::printf("film %d: %zu heads, %s: %s\n", i, heads.size(), kind.c_str(),
                    times ? "accepted" : times.error().message.c_str());
      ++(times ? accepted : refused)[source];
      for (std::size_t h = 1; times && h < heads.size(); ++h) {
        const std::string name = source + " of film " + std::to_string(i) + ", " + heads[h].name;
        compare(name, film.clocks[h], film.clocks[0], times->heads[h], film.seconds, bound, by_source[source]);
      }
    }
    std::fflush(stdout);
  }
  std::printf(
      "\n| sources | heads | median ms | 95 %% ms | largest ms | median ppm | 95 %% ppm | within 1 sigma %% | within 2 "
      "%% | wrong |\n");
  std::printf("|---|---|---|---|---|---|---|---|---|---|\n");
  int wrong = 0;
  for (const auto& [source, errors] : by_source) print(source, errors), wrong += errors.wrong;
  for (const auto& [source, count] : accepted) {
    std::printf("%s: %d films accepted, %d refused\n", source.c_str(), count, refused[source]);
  }
  return wrong == 0 ? 0 : 1;
}

}  // namespace
}  // namespace nodal::timing

int main(int argc, char** argv) {
  CLI::App app("Clocks of simulated films' heads against the truth");
  int films = 200, first = 1;
  double bound_ms = 16;
  app.add_option("--films", films, "number of films");
  app.add_option("--first", first, "seed of the first film");
  app.add_option("--bound", bound_ms, "a time that is off by more is wrong, ms");
  CLI11_PARSE(app, argc, argv);
  return nodal::timing::run(films, first, bound_ms / 1e3);
}
