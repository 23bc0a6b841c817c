#include "stitch/timing/film_times.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "protocol/base/try.h"
#include "stitch/timing/clock_graph.h"

namespace nodal::timing {
namespace {

constexpr double kContradiction = 30;   // about 5 sigma of two numbers
constexpr double kOpenSigma = 0.05;     // s: what the others say less surely than this confirms nothing
constexpr double kContainerBound = 12;  // s: four sigma of a container's 3 s
std::string advice(const std::string& head) {
  return fmt::format("film a clap or move the rig at the start and at the end, or give --offset {}=SECONDS", head);
}

/// The heads that lags join to the reference.
std::vector<bool> joined(std::size_t heads, int reference, std::span<const PairLag> lags,
                         const std::vector<bool>& used) {
  std::vector<bool> reached(heads, false);
  reached[static_cast<std::size_t>(reference)] = true;
  for (std::size_t round = 0; round < heads; ++round) {
    for (std::size_t i = 0; i < lags.size(); ++i) {
      const auto a = static_cast<std::size_t>(lags[i].a), b = static_cast<std::size_t>(lags[i].b);
      if (used[i] && reached[a] != reached[b]) reached[a] = reached[b] = true;
    }
  }
  return reached;
}

class Judge {
 public:
  Judge(std::span<const HeadFilm> heads, std::span<const PairLag> lags, int reference)
      : heads_(heads), lags_(lags), reference_(reference), used_(lags.size(), true) {}

  ClockGraph solved(const std::vector<bool>& used) const {
    return ClockGraph(static_cast<int>(heads_.size()), reference_, lags_, used);
  }
  const std::vector<bool>& used() const { return used_; }
  std::string words(std::size_t i) const {
    const PairLag& lag = lags_[i];
    return fmt::format("{} of heads '{}' and '{}'", name_of(lag.source), heads_[static_cast<std::size_t>(lag.a)].name,
                       heads_[static_cast<std::size_t>(lag.b)].name);
  }

  /// Leaves out lags from a single flash that no other source confirms.
  void drop_unconfirmed(std::vector<std::string>& notes) {
    std::vector<bool> solid(lags_.size());
    for (std::size_t i = 0; i < lags_.size(); ++i) solid[i] = lags_[i].lag.used > 1;
    const ClockGraph graph = solved(solid);
    for (std::size_t i = 0; i < lags_.size(); ++i) {
      if (solid[i] || std::sqrt(graph.covariance_of(lags_[i])(0, 0)) < kOpenSigma) continue;
      used_[i] = false;
      notes.push_back(
          fmt::format("The {} is not used: a single event proves nothing, and no other source confirms it.", words(i)));
    }
  }

  /// Contradictions of every used lag with all others; 0 for those that are not used.
  std::vector<double> contradictions(const std::vector<bool>& used) const {
    std::vector<double> sizes(lags_.size(), 0.0);
    for (std::size_t i = 0; i < lags_.size(); ++i) {
      if (!used[i]) continue;
      std::vector<bool> others = used;
      others[i] = false;
      sizes[i] = contradiction(lags_[i], solved(others));
    }
    return sizes;
  }

  /// Leaves out lags until the rest agrees.
  Status drop_outliers(std::vector<std::string>& notes) {
    for (std::size_t dropped = 0;; ++dropped) {
      const auto sizes = contradictions(used_);
      const auto worst = static_cast<std::size_t>(std::ranges::max_element(sizes) - sizes.begin());
      if (sizes.empty() || sizes[worst] < kContradiction) return {};
      std::vector<std::size_t> cures;
      for (std::size_t i = 0; i < lags_.size(); ++i) {
        if (sizes[i] < kContradiction) continue;
        std::vector<bool> without = used_;
        without[i] = false;
        const auto rest = contradictions(without);
        if (std::ranges::max(rest) < kContradiction) cures.push_back(i);
      }
      if (cures.size() > 1 || 3 * (dropped + 1) > lags_.size()) return undecided(cures, worst);
      const std::size_t out = cures.empty() ? worst : cures[0];
      used_[out] = false;
      notes.push_back(fmt::format("The {} is left out: it contradicts all others.", words(out)));
    }
  }

 private:
  tl::unexpected<Error> undecided(const std::vector<std::size_t>& cures, std::size_t worst) const {
    std::string which = words(worst);
    for (std::size_t k = 0; k < std::min<std::size_t>(cures.size(), 4); ++k) {
      if (cures[k] != worst) which += ", the " + words(cures[k]);
    }
    const std::string& head = heads_[static_cast<std::size_t>(lags_[worst].b)].name;
    return fail(
        Errc::kNotDetermined,
        fmt::format("the times of heads contradict each other, and nothing tells which is wrong: the {}; are all "
                    "films of one take? If they are, give --offset {}=SECONDS",
                    which, head));
  }

  std::span<const HeadFilm> heads_;
  std::span<const PairLag> lags_;
  int reference_;
  std::vector<bool> used_;
};

/// Why a head has no lag, as far as sources said.
std::string reasons(int head, std::span<const NoLag> missing) {
  std::set<std::string> all;
  for (const NoLag& m : missing) {
    if (m.a == head || m.b == head) all.insert(fmt::format("{}: {}", name_of(m.source), m.why));
  }
  std::string text;
  int count = 0;
  for (const std::string& why : all) {
    if (count++ < 3) text += (text.empty() ? " (" : "; ") + why;
  }
  return text.empty() ? text : text + ")";
}

std::string sources_of(int head, std::span<const PairLag> lags, const std::vector<bool>& used) {
  std::string text;
  for (int s = 0; s < kSources; ++s) {
    for (std::size_t i = 0; i < lags.size(); ++i) {
      if (!used[i] || static_cast<int>(lags[i].source) != s || (lags[i].a != head && lags[i].b != head)) continue;
      text += fmt::format("{}{}", text.empty() ? "" : " and ", name_of(lags[i].source));
      break;
    }
  }
  return text;
}

Status check(std::span<const HeadFilm> heads, std::span<const PairLag> lags, int reference) {
  const auto is_head = [&](int head) { return head >= 0 && head < static_cast<int>(heads.size()); };
  if (!is_head(reference)) return fail(Errc::kBadValue, "the reference for times is not one of the heads");
  for (const PairLag& pair : lags) {
    if (!is_head(pair.a) || !is_head(pair.b) || pair.a == pair.b) {
      return fail(Errc::kBadValue, "a lag is not of two heads of the film");
    }
    const Lag& l = pair.lag;
    for (const double x : {l.at, l.lag, l.rate, l.covariance, l.lag_variance, l.rate_variance}) {
      if (!std::isfinite(x)) return fail(Errc::kBadValue, "a lag is not finite");
    }
    if (l.lag_variance < 0 || l.rate_variance < 0 || l.covariance * l.covariance > l.lag_variance * l.rate_variance) {
      return fail(Errc::kBadValue, "a lag's variances cannot be");
    }
  }
  return {};
}

}  // namespace

std::string_view name_of(Source source) {
  constexpr std::string_view kNames[kSources] = {"sound", "rotation", "flash"};
  return kNames[static_cast<int>(source)];
}

Result<FilmTimes> film_times(std::span<const HeadFilm> heads, std::span<const PairLag> lags,
                             std::span<const NoLag> missing, const FilmOptions& options) {
  NODAL_TRY(check(heads, lags, options.reference));
  FilmTimes times;
  Judge judge(heads, lags, options.reference);
  judge.drop_unconfirmed(times.notes);
  NODAL_TRY(judge.drop_outliers(times.notes));
  const std::vector<bool>& used = judge.used();
  const auto reached = joined(heads.size(), options.reference, lags, used);
  const ClockGraph graph = judge.solved(used);

  double squares = 0;
  int count = 0;
  for (std::size_t i = 0; i < lags.size(); ++i) {
    if (!used[i]) continue;
    const double residual = graph.residual(lags[i])[0];
    squares += residual * residual, ++count;
  }
  times.residual = count > 0 ? std::sqrt(squares / count) : 0;
  for (int head = 0; head < static_cast<int>(heads.size()); ++head) {
    const HeadFilm& film = heads[static_cast<std::size_t>(head)];
    if (head == options.reference) {
      times.heads.push_back({});
      continue;
    }
    if (!reached[static_cast<std::size_t>(head)]) {
      return fail(Errc::kNotDetermined, fmt::format("head '{}': its time is not known{}; {}", film.name,
                                                    reasons(head, missing), advice(film.name)));
    }
    const HeadTime time{graph.offset(head), graph.rate(head) * 1e6,
                        std::max(graph.sigma(head, film.start), graph.sigma(head, film.end)),
                        graph.rate_sigma(head) * 1e6, sources_of(head, lags, used)};
    if (time.sigma > options.largest_sigma) {
      return fail(Errc::kNotDetermined,
                  fmt::format("head '{}': its time is known to {:.1f} ms only, and {:.1f} ms are needed; {}", film.name,
                              time.sigma * 1e3, options.largest_sigma * 1e3, advice(film.name)));
    }
    if (film.container && std::abs(*film.container - time.offset) > kContainerBound) {
      return fail(
          Errc::kNotDetermined,
          fmt::format("head '{}': {} puts it {:.1f} s away from the time in its file; is it of the same take? If "
                      "it is, give --offset {}=SECONDS",
                      film.name, time.sources, std::abs(*film.container - time.offset), film.name));
    }
    times.heads.push_back(time);
  }
  return times;
}

}  // namespace nodal::timing
