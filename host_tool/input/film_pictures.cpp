#include "host_tool/input/film_pictures.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <memory>
#include <utility>

#include "host_tool/input/matroska_film.h"
#include "protocol/base/try.h"

namespace nodal::host {
namespace {

constexpr std::int64_t kUsualPeriod = 1'000'000'000 / 30;  // ns, of a film with one picture

struct NamedFilm {
  std::string file;
  std::unique_ptr<Film> film;

  std::int64_t end_ns() const { return film->begin_ns() + film->times().back(); }
  std::int64_t period_ns() const {
    const auto steps = static_cast<std::int64_t>(film->times().size()) - 1;
    return steps > 0 ? std::max<std::int64_t>(1, film->times().back() / steps) : kUsualPeriod;
  }
  /// The picture that is nearest to this time.
  std::size_t nearest(std::int64_t time_ns) const {
    const std::vector<std::int64_t>& times = film->times();
    const auto after = std::ranges::lower_bound(times, time_ns - film->begin_ns());
    const auto k = static_cast<std::size_t>(after - times.begin());
    if (k == 0) return 0;
    if (k == times.size()) return k - 1;
    return std::abs(time_of(k) - time_ns) < std::abs(time_of(k - 1) - time_ns) ? k : k - 1;
  }
  std::int64_t time_of(std::size_t k) const { return film->begin_ns() + film->times()[k]; }
};

/// The picture of each film at the time of the first film's picture `lead`; empty where a film has none.
std::vector<std::size_t> whole_set(const std::vector<NamedFilm>& films, std::size_t lead) {
  std::vector<std::size_t> places;
  const std::int64_t moment = films.front().time_of(lead);
  for (const NamedFilm& film : films) {
    places.push_back(film.nearest(moment));
    if (std::abs(film.time_of(places.back()) - moment) > films.front().period_ns() / 2) return {};
  }
  return places;
}

/// The same for the nearest picture that has a whole set: cameras lose pictures.
std::vector<std::size_t> nearest_whole(const std::vector<NamedFilm>& films, std::size_t lead) {
  const std::size_t length = films.front().film->times().size();
  for (std::size_t step = 0; step < length; ++step) {
    for (const std::size_t place : {lead - step, lead + step}) {  // before the first, a number beyond the last
      if (place >= length) continue;
      if (std::vector<std::size_t> places = whole_set(films, place); !places.empty()) return places;
    }
  }
  return {};
}

}  // namespace

bool are_films(const std::vector<std::string>& files) {
  return !files.empty() && std::ranges::all_of(files, is_matroska);
}

Result<std::vector<std::vector<HeadPicture>>> film_pictures(const std::vector<std::string>& files, int sets,
                                                            std::vector<std::string>& notes) {
  std::vector<NamedFilm> films;
  for (const std::string& file : files) {
    NODAL_TRY_ASSIGN(std::unique_ptr<Film> film, open_matroska(file));
    films.push_back({file, std::move(film)});
  }
  const auto last = std::ranges::max_element(films, {}, [](const NamedFilm& f) { return f.film->begin_ns(); });
  const auto first = std::ranges::min_element(films, {}, &NamedFilm::end_ns);
  const std::int64_t begin = last->film->begin_ns(), length = first->end_ns() - begin;
  const NamedFilm& lead = films.front();
  const auto shown = [&lead](std::int64_t ns) { return static_cast<double>(ns - lead.film->begin_ns()) / 1e9; };
  if (length < 0) {
    return fail(Errc::kBadValue,
                fmt::format("{} ends at {:.2f} s and {} begins at {:.2f} s of {}; give films of one take", first->file,
                            shown(first->end_ns()), last->file, shown(begin), lead.file));
  }
  const std::int64_t count =
      std::clamp<std::int64_t>(static_cast<std::int64_t>(lead.film->times().size()), 1, std::max(1, sets));
  std::vector<std::vector<HeadPicture>> all;
  std::string moments;
  for (std::int64_t k = 0; k < count; ++k) {
    const auto wanted = lead.nearest(begin + (2 * k + 1) * length / (2 * count));
    const std::vector<std::size_t> places = nearest_whole(films, wanted);
    if (places.empty()) {
      return fail(Errc::kBadValue, fmt::format("at no time do all films have a picture within {} ms of those of {}; "
                                               "give films of one take, whose cameras have one trigger",
                                               lead.period_ns() / 2'000'000, lead.file));
    }
    moments += fmt::format("{}{:.2f}", moments.empty() ? "" : ", ", shown(lead.time_of(places.front())));
    std::vector<HeadPicture>& set = all.emplace_back();
    for (std::size_t f = 0; f < films.size(); ++f) {
      NODAL_TRY_ASSIGN(const std::vector<std::uint8_t> jpeg, films[f].film->frame(places[f]));
      NODAL_TRY_ASSIGN(DecodedImage picture, picture_of(jpeg, films[f].file));
      set.emplace_back(std::move(picture));
    }
  }
  notes.push_back(fmt::format("{} films: the pictures at {} s of the {:.2f} s of {}", films.size(), moments,
                              shown(lead.end_ns()), lead.file));
  return all;
}

}  // namespace nodal::host
