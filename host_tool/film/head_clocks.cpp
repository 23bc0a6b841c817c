#include "host_tool/film/head_clocks.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "host_tool/film/head_sound.h"
#include "host_tool/film/head_turns.h"
#include "host_tool/film/sound_file.h"
#include "protocol/base/try.h"
#include "stitch/timing/film_times.h"
#include "stitch/timing/flash_lag.h"
#include "stitch/timing/rotation_lag.h"
#include "stitch/timing/sound_lag.h"

namespace nodal::film {
namespace {

constexpr double kPerPpm = 1e6;  // millionths of one
constexpr double kReach = 60;    // s; cameras that people start one by one. More costs time, and finds more by chance
constexpr double kContainerReach = 12;  // s: four sigma of the times in files, which cameras' owners set by hand
constexpr std::size_t kAllPairs = 4;    // with more heads, each is compared with the next two

using GoOn = std::function<bool(const std::string&, double)>;
using timing::Source;

/// What is known of one head.
struct HeadEvidence {
  std::optional<timing::SoundTrack> sound;
  std::optional<timing::Rotation> rotation;
  std::optional<timing::Brightness> brightness;
  bool gyro = false;  ///< whether `rotation` comes from a gyro
};

/// GoPro's telemetry has no time for each sample, only for each second's payload, in ms, and the payloads are not
/// equally long: cut clips had rates that were off by 200 ppm of 10 s. So each gyro adds an error of 1 ms.
void widen(timing::Lag& lag, const timing::Rotation& a, const timing::Rotation& b, int gyros) {
  constexpr double kPayloadSigma = 1e-3, kRateOfLine = 12;  // variance of a line's slope: 12 sigma^2 / length^2
  const double length = std::min(a.times.back() - a.times.front(), b.times.back() - b.times.front());
  const double variance = gyros * kPayloadSigma * kPayloadSigma;
  lag.lag_variance += variance;
  lag.rate_variance += kRateOfLine * variance / (length * length);
}

class ClockSearch {
 public:
  ClockSearch(const Programs& programs, const std::vector<FilmFile>& films, const Calibration& calibration,
              const ClockSources& sources, const std::string& scratch, std::vector<std::string>& notes,
              const GoOn& go_on)
      : programs_(programs),
        films_(films),
        calibration_(calibration),
        sources_(sources),
        scratch_(scratch),
        notes_(notes),
        go_on_(go_on) {}

  /// `asked`: the heads whose clocks are wanted; the first one is the reference.
  Result<timing::FilmTimes> run(const std::vector<std::size_t>& asked) {
    for (const std::size_t h : asked) {
      const FilmFile& film = films_[h];
      timing::HeadFilm known{calibration_.heads[h].name, 0, film.seconds(film.times.size() - 1), {}};
      if (!sources_.named) known.container = container_time(films_[asked.front()], film);
      asked_.push_back(h);
      heads_.push_back(std::move(known));
    }
    evidence_.resize(asked_.size());
    NODAL_TRY(hear());
    NODAL_TRY(read_gyros());
    compare();
    auto times = solve();
    const bool pictures = sources_.rotation || sources_.flash;
    const bool enough = times && !sources_.named;
    if (enough || !pictures || (!times && times.error().code != Errc::kNotDetermined)) return times;
    NODAL_TRY(look());
    compare();
    return solve();
  }

 private:
  /// The reference's time minus the head's own, by the dates in the files.
  static std::optional<double> container_time(const FilmFile& reference, const FilmFile& film) {
    if (!reference.created_s || !film.created_s) return std::nullopt;
    return *film.created_s - *reference.created_s;
  }

  Status hear() {
    for (std::size_t k = 0; sources_.sound && k < asked_.size(); ++k) {
      const FilmFile& film = films_[asked_[k]];
      if (!film.sound) continue;
      const double done = static_cast<double>(k) / static_cast<double>(asked_.size());
      NODAL_TRY_ASSIGN(auto store, SoundFile::make(scratch_));
      auto track = track_of(programs_, film, std::move(store), [&] { return go_on_("listening to the films", done); });
      if (!track && track.error().code == Errc::kBadValue) {  // sound of a rate that cannot be used
        notes_.push_back(track.error().message);
        continue;
      }
      NODAL_TRY_ASSIGN(evidence_[k].sound, std::move(track));
    }
    return {};
  }

  Status read_gyros() {
    for (std::size_t k = 0; sources_.gyro && k < asked_.size(); ++k) {
      const FilmFile& film = films_[asked_[k]];
      if (!film.gpmf) continue;
      if (!go_on_("reading the gyros", static_cast<double>(k) / static_cast<double>(asked_.size()))) return stopped();
      auto gyro = gyro_of(programs_, film);
      evidence_[k].gyro = gyro.has_value() && gyro->times.size() > 2;
      if (evidence_[k].gyro) evidence_[k].rotation = std::move(*gyro);
      else if (!gyro) notes_.push_back(gyro.error().message);
    }
    return {};
  }

  /// Decodes the pictures of those that have no gyro, and of all if flashes count.
  Status look() {
    for (std::size_t k = 0; k < asked_.size(); ++k) {
      if (evidence_[k].rotation && !sources_.flash) continue;
      const auto done = [&](double part) {
        return go_on_("looking for motion and flashes",
                      (static_cast<double>(k) + part) / static_cast<double>(asked_.size()));
      };
      NODAL_TRY_ASSIGN(SeenMotion seen, motion_of(programs_, films_[asked_[k]], calibration_.heads[asked_[k]],
                                                  sources_.readout_s, done));
      if (sources_.rotation && !evidence_[k].rotation && seen.rotation.times.size() > 2) {
        evidence_[k].rotation = std::move(seen.rotation);
      }
      if (sources_.flash) evidence_[k].brightness = std::move(seen.brightness);
    }
    return {};
  }

  /// Compares the heads that have a kind of evidence: all pairs of a few, of more each with the next two, in a ring.
  template <class Evidence, class LagOf>
  void compare_pairs(Source source, const Evidence& evidence, const LagOf& lag_of) {
    std::vector<int> having;
    for (std::size_t k = 0; k < asked_.size(); ++k) {
      if (evidence(k)) having.push_back(static_cast<int>(k));
    }
    const std::size_t count = having.size();
    for (std::size_t i = 0; i < count; ++i) {
      for (std::size_t j = i + 1; j < count; ++j) {
        const std::size_t apart = std::min(j - i, count - (j - i));
        if (count > kAllPairs && apart > 2) continue;
        if (!go_on_("comparing the films", static_cast<double>(i) / static_cast<double>(count))) return;
        const auto lag = lag_between(having[i], having[j], lag_of);
        if (lag) lags_.push_back({having[i], having[j], source, *lag});
        else missing_.push_back({having[i], having[j], source, lag.error().message});
      }
    }
  }

  /// Within a minute, and where the times in the files put it.
  template <class LagOf>
  Result<timing::Lag> lag_between(int a, int b, const LagOf& lag_of) {
    const auto& first = heads_[static_cast<std::size_t>(a)];
    const auto& second = heads_[static_cast<std::size_t>(b)];
    auto lag = lag_of(a, b, timing::Search{.expected = 0, .reach = std::min(kReach, std::max(first.end, second.end))});
    const std::optional<double> one =
        container_time(films_[asked_.front()], films_[asked_[static_cast<std::size_t>(a)]]);
    const std::optional<double> two =
        container_time(films_[asked_.front()], films_[asked_[static_cast<std::size_t>(b)]]);
    if (lag || lag.error().code != Errc::kNotDetermined || !one || !two) return lag;
    const double expected = *one - *two;
    const bool overlap = expected > -first.end && expected < second.end;
    if (std::abs(expected) < kReach - kContainerReach || !overlap) return lag;
    auto other = lag_of(a, b, timing::Search{.expected = expected, .reach = kContainerReach});
    return other ? other : lag;
  }

  /// Lags of all evidence so far; again from the beginning.
  void compare() {
    lags_.clear();
    missing_.clear();
    const auto at = [&](int k) -> const HeadEvidence& { return evidence_[static_cast<std::size_t>(k)]; };
    compare_pairs(
        Source::kSound, [&](std::size_t k) { return evidence_[k].sound.has_value(); },
        [&](int a, int b, const timing::Search& search) {
          return timing::sound_lag(*at(a).sound, *at(b).sound, search);
        });
    compare_pairs(
        Source::kRotation, [&](std::size_t k) { return evidence_[k].rotation.has_value(); },
        [&](int a, int b, const timing::Search& search) {
          auto lag = timing::rotation_lag(*at(a).rotation, *at(b).rotation, search);
          const int gyros = (at(a).gyro ? 1 : 0) + (at(b).gyro ? 1 : 0);
          if (lag && gyros > 0) widen(*lag, *at(a).rotation, *at(b).rotation, gyros);
          return lag;
        });
    compare_pairs(
        Source::kFlash, [&](std::size_t k) { return evidence_[k].brightness.has_value(); },
        [&](int a, int b, const timing::Search& search) {
          return timing::flash_lag(*at(a).brightness, *at(b).brightness, search);
        });
  }

  Result<timing::FilmTimes> solve() {
    if (!go_on_("comparing the films", 1)) return stopped();
    return timing::film_times(heads_, lags_, missing_, {});
  }

  static tl::unexpected<Error> stopped() { return fail(Errc::kCancelled, "stopped"); }

  const Programs& programs_;
  const std::vector<FilmFile>& films_;
  const Calibration& calibration_;
  const ClockSources& sources_;
  const std::string& scratch_;
  std::vector<std::string>& notes_;
  const GoOn& go_on_;
  std::vector<std::size_t> asked_;  ///< places in the list of films
  std::vector<timing::HeadFilm> heads_;
  std::vector<HeadEvidence> evidence_;
  std::vector<timing::PairLag> lags_;
  std::vector<timing::NoLag> missing_;
};

/// The time of a head, `by` against the reference whose own time is given: t_head = offset + t_ref (1 + ppm).
HeadTime beside(const HeadTime& reference, const HeadTime& head) {
  HeadTime time = head;
  const double clock = 1 + head.ppm / kPerPpm;
  time.offset_s = head.offset_s + clock * reference.offset_s;
  time.ppm = kPerPpm * (clock * (1 + reference.ppm / kPerPpm) - 1);
  return time;
}

}  // namespace

Result<ClockSources> parse_clock_sources(const std::string& text) {
  ClockSources sources{false, false, false, false, true, 0};
  for (std::size_t at = 0; at <= text.size();) {
    const std::size_t end = std::min(text.find(',', at), text.size());
    const std::string word = text.substr(at, end - at);
    if (word == "sound") sources.sound = true;
    else if (word == "gyro") sources.gyro = true;
    else if (word == "rotation") sources.rotation = true;
    else if (word == "flash") sources.flash = true;
    else {
      return fail(
          Errc::kBadValue,
          fmt::format("'{}': write begin, or some of sound,gyro,rotation,flash with commas between them", text));
    }
    at = end + 1;
  }
  return sources;
}

Result<HeadClocks> find_clocks(const Programs& programs, const std::vector<FilmFile>& films,
                               const Calibration& calibration, const std::vector<HeadTime>& given,
                               const ClockSources& sources, const std::string& scratch, std::vector<std::string>& notes,
                               const GoOn& go_on) {
  HeadClocks clocks;
  std::vector<std::size_t> asked;  // the first head, against which times are, and all whose time is not given
  for (std::size_t h = 0; h < films.size(); ++h) {
    const std::string& name = calibration.heads[h].name;
    const auto known = std::ranges::find(given, name, &HeadTime::head);
    clocks.times.push_back(known != given.end() ? *known : HeadTime{name, 0, 0});
    clocks.times.back().by = known != given.end() ? "--offset" : h == 0 ? "reference" : "";
    if (h == 0 || known == given.end()) asked.push_back(h);
  }
  if (asked.size() < 2) return clocks;
  ClockSearch search(programs, films, calibration, sources, scratch, notes, go_on);
  NODAL_TRY_ASSIGN(const timing::FilmTimes found, search.run(asked));
  notes.insert(notes.end(), found.notes.begin(), found.notes.end());
  clocks.residual_s = found.residual;
  const HeadTime& reference = clocks.times.front();
  for (std::size_t k = 1; k < asked.size(); ++k) {
    // The first head's time = offset + clock * time of the head.
    const timing::HeadTime& head = found.heads[k];
    const double clock = 1 + head.ppm / kPerPpm;
    HeadTime& time = clocks.times[asked[k]];
    const HeadTime against{time.head,  -head.offset / clock, kPerPpm * (1 / clock - 1),
                           head.sigma, head.ppm_sigma,       head.sources};
    time = beside(reference, against);
    notes.push_back(fmt::format("head '{}': {:+.4f} s, {:+.1f} ppm against '{}', ± {:.1f} ms and {:.1f} ppm, by {}",
                                time.head, against.offset_s, against.ppm, reference.head, 1000 * head.sigma,
                                head.ppm_sigma, head.sources));
  }
  if (found.residual > 0) {
    notes.push_back(fmt::format("the times of pairs of heads differ from these by {:.2f} ms (root mean square)",
                                1000 * found.residual));
  }
  return clocks;
}

}  // namespace nodal::film
