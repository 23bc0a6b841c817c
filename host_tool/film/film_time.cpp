#include "host_tool/film/film_time.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "protocol/base/try.h"

namespace nodal::film {
namespace {

constexpr double kMillion = 1e6;

double rig_seconds(const HeadTime& head, double head_s) { return (head_s - head.offset_s) / (1 + head.ppm / kMillion); }

}  // namespace

FrameRate usual_rate(FrameRate rate) {
  constexpr double kNear = 3e-4;  // 30 and 29.97 differ by 1e-3
  constexpr std::array kUsual{FrameRate{24000, 1001}, FrameRate{24, 1},        FrameRate{25, 1},
                              FrameRate{30000, 1001}, FrameRate{30, 1},        FrameRate{48, 1},
                              FrameRate{50, 1},       FrameRate{60000, 1001},  FrameRate{60, 1},
                              FrameRate{100, 1},      FrameRate{120000, 1001}, FrameRate{120, 1}};
  const auto hertz = [](FrameRate r) { return static_cast<double>(r.numerator) / r.denominator; };
  for (const FrameRate usual : kUsual) {
    if (std::abs(hertz(rate) / hertz(usual) - 1) < kNear) return usual;
  }
  return rate;
}

double head_seconds(const HeadTime& head, double rig_s) { return rig_s + head.offset_s + rig_s * head.ppm / kMillion; }

Result<FilmSpan> common_span(const std::vector<FilmFile>& films, const std::vector<HeadTime>& times, double period_s) {
  std::size_t latest = 0, earliest = 0, longest = 0;
  std::vector<double> begins, ends;
  for (std::size_t h = 0; h < films.size(); ++h) {
    begins.push_back(rig_seconds(times[h], 0));
    ends.push_back(rig_seconds(times[h], films[h].seconds(films[h].times.size() - 1)));
    if (begins[h] > begins[latest]) latest = h;
    if (ends[h] < ends[earliest]) earliest = h;
    if (ends[h] > ends[longest]) longest = h;
  }
  FilmSpan span{begins[latest], 0, ""};
  const double length = ends[earliest] - span.from_s;
  if (length < 0) {
    return fail(Errc::kBadValue,
                fmt::format("the films have no time in common: {} begins {:.3f} s after the end of {}; check --offset",
                            films[latest].path, -length, films[earliest].path));
  }
  constexpr double kRounding = 1e-4;  // part of a period: times in milliseconds are rounded
  constexpr double kMaxFrames = FilmPlan::kMaxFrames;
  if (!(length / period_s < kMaxFrames - 1)) {
    return fail(Errc::kTooLarge, fmt::format("{}: the result would have over {} frames; make films of parts of it",
                                             films[earliest].path, FilmPlan::kMaxFrames));
  }
  span.frames = static_cast<std::uint64_t>(std::floor(length / period_s + kRounding)) + 1;
  const double more = ends[longest] - ends[earliest];
  if (more > 1.5 * period_s) {
    span.ends_early = fmt::format("the result ends after {:.3f} s, because {} ends there; {} goes on for {:.3f} s",
                                  length + period_s, films[earliest].path, films[longest].path, more);
  }
  return span;
}

Result<FilmSpan> chosen_span(const std::vector<FilmFile>& films, const std::vector<HeadTime>& times, bool preview,
                             FrameRate& rate) {
  const auto period = [&] { return 1.0 * rate.denominator / rate.numerator; };
  NODAL_TRY_ASSIGN(FilmSpan span, common_span(films, times, period()));
  if (!preview || span.frames <= kPreviewFrames) return span;
  const std::uint64_t one_in = (span.frames + kPreviewFrames - 1) / kPreviewFrames;
  const auto slow = FrameRate::make(rate.numerator, std::uint64_t{rate.denominator} * one_in);
  if (!slow) return fail(Errc::kTooLarge, films.front().path + ": the film is too long for a preview");
  rate = *slow;
  return common_span(films, times, period());
}

std::vector<std::size_t> nearest_frames(const FilmFile& film, const HeadTime& time, const FilmSpan& span,
                                        double period_s, double* farthest_s) {
  std::vector<std::size_t> chosen;
  chosen.reserve(span.frames);
  std::size_t frame = 0;
  *farthest_s = 0;
  for (std::uint64_t k = 0; k < span.frames; ++k) {
    const double wanted = head_seconds(time, span.from_s + static_cast<double>(k) * period_s);
    const auto distance = [&](std::size_t f) { return std::abs(film.seconds(f) - wanted); };
    while (frame + 1 < film.times.size() && film.seconds(frame + 1) <= wanted) ++frame;
    // Of two that are equally near, within what doubles can tell, the earlier one.
    constexpr double kEqual = 1e-9;
    const bool later = frame + 1 < film.times.size() && distance(frame + 1) < distance(frame) - kEqual;
    chosen.push_back(later ? frame + 1 : frame);
    *farthest_s = std::max(*farthest_s, distance(chosen.back()));
  }
  return chosen;
}

}  // namespace nodal::film
