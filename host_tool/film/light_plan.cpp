#include "host_tool/film/light_plan.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <memory>
#include <utility>

#include "host_tool/film/head_film.h"
#include "protocol/base/try.h"
#include "stitch/calibration/light/relative_light.h"
#include "stitch/geometry/head.h"

namespace nodal::film {
namespace {

constexpr double kSeen = 0.04;      // stops; what overlaps show below this may be their misalignment
constexpr double kMaxLight = 3;     // stops
constexpr double kUncertain = 0.1;  // stops; a measurement with a larger standard deviation is not used
constexpr std::uint64_t kMinMoments = 8;

/// The luma of a picture as grey RGB, in full range.
std::vector<std::uint8_t> grey_rgb(const ImageView& picture) {
  constexpr int kBlack = 16, kWhite = 235;  // video range
  std::vector<std::uint8_t> bytes;
  bytes.reserve(3 * static_cast<std::size_t>(picture.width) * static_cast<std::size_t>(picture.height));
  const bool rgb = picture.format == PixelFormat::kRgb24;
  const bool video = picture.coding.video_range && !rgb;
  const auto value = [&](const PlaneView& plane, int x, int y) {
    return static_cast<int>(plane.data[y * plane.row_stride + x * plane.pixel_stride]);
  };
  for (int y = 0; y < picture.height; ++y) {
    for (int x = 0; x < picture.width; ++x) {
      int luma = value(picture.planes[0], x, y);
      if (rgb) luma = (299 * luma + 587 * value(picture.planes[1], x, y) + 114 * value(picture.planes[2], x, y)) / 1000;
      if (video) luma = std::clamp((luma - kBlack) * 255 / (kWhite - kBlack), 0, 255);
      bytes.insert(bytes.end(), 3, static_cast<std::uint8_t>(luma));
    }
  }
  return bytes;
}

Result<LightMoment> measure(const FilmPlan& plan, const Programs& programs, const std::vector<geometry::Head>& heads,
                            std::uint64_t frame) {
  std::vector<std::unique_ptr<HeadFilm>> films;  // all decode at once
  for (const PlannedHead& head : plan.heads) {
    NODAL_TRY_ASSIGN(auto film, HeadFilm::open(programs, head.film, head.times[frame]));
    films.push_back(std::move(film));
  }
  std::vector<std::vector<std::uint8_t>> bytes;
  calibration::ExposedSet set;
  for (std::size_t h = 0; h < films.size(); ++h) {
    NODAL_TRY_ASSIGN(const ImageView picture, films[h]->at(plan.heads[h].times[frame]));
    bytes.push_back(grey_rgb(picture));
    set.frames.push_back(
        packed_image(PixelFormat::kRgb24, picture.width, picture.height, std::as_const(bytes.back()).data()));
    films[h].reset();
  }
  const calibration::RelativeLight light = calibration::relative_light(plan.calibration, heads, set);
  LightMoment moment;
  for (std::size_t h = 0; h < heads.size(); ++h) {
    const bool known = light.sigma[h] < kUncertain;
    moment.push_back(known ? std::clamp(light.stops[h], -kMaxLight, kMaxLight)
                           : std::numeric_limits<double>::quiet_NaN());
  }
  return moment;
}

double median(double a, double b, double c) { return std::max(std::min(a, b), std::min(std::max(a, b), c)); }

/// Each value as the median of three: a single one that differs from both neighbours is no exposure. The first and the
/// last one, which have one neighbour, also take part in the line through the next two (Tukey's end point rule).
std::vector<double> without_outliers(const std::vector<double>& values) {
  const std::size_t count = values.size();
  if (count < 3) return values;
  std::vector<double> smooth = values;
  for (std::size_t k = 1; k + 1 < count; ++k) smooth[k] = median(values[k - 1], values[k], values[k + 1]);
  smooth[0] = median(values[0], smooth[1], 3 * smooth[1] - 2 * smooth[std::min<std::size_t>(2, count - 2)]);
  const std::size_t last = count - 1;
  smooth[last] =
      median(values[last], smooth[last - 1], 3 * smooth[last - 1] - 2 * smooth[std::max<std::size_t>(last - 2, 1)]);
  return smooth;
}

}  // namespace

Stops PlannedLight::at(std::size_t head, std::uint64_t frame) const {
  if (frames.empty()) return 0;
  const std::vector<Stops>& own = stops[head];
  const auto after = static_cast<std::size_t>(std::ranges::upper_bound(frames, frame) - frames.begin());
  if (after == 0) return own.front();
  if (after == frames.size()) return own.back();
  const auto passed = static_cast<std::int64_t>(frame - frames[after - 1]);
  const auto length = static_cast<std::int64_t>(frames[after] - frames[after - 1]);
  return own[after - 1] + static_cast<Stops>((own[after] - own[after - 1]) * passed / length);
}

PlannedLight light_of(const std::vector<std::uint64_t>& frames, const std::vector<LightMoment>& moments) {
  PlannedLight light;
  double largest = 0;
  for (std::size_t h = 0; h < moments.front().size(); ++h) {
    std::vector<std::size_t> known;  // indices of moments
    std::vector<double> measured;
    for (std::size_t k = 0; k < moments.size(); ++k) {
      if (std::isnan(moments[k][h])) continue;
      known.push_back(k);
      measured.push_back(moments[k][h]);
    }
    const std::vector<double> smooth = without_outliers(measured);
    std::vector<Stops> own(moments.size(), 0);
    for (std::size_t k = 0; k < moments.size() && !known.empty(); ++k) {
      const auto next = std::ranges::lower_bound(known, k);
      const double stops =
          smooth[static_cast<std::size_t>((next == known.end() ? std::prev(next) : next) - known.begin())];
      largest = std::max(largest, std::abs(stops));
      own[k] = static_cast<Stops>(std::lround(stops * kStop));
    }
    light.stops.push_back(std::move(own));
  }
  if (largest < kSeen) return {};
  light.frames = frames;
  return light;
}

Status plan_light(FilmPlan& plan, const Programs& programs, const std::function<bool(double)>& go_on,
                  std::vector<std::string>& notes) {
  const auto heads = geometry::make_heads(plan.calibration);
  if (!heads) return fail(heads.error());
  const std::uint64_t step = std::clamp<std::uint64_t>(plan.frames / kMinMoments, 1, kLightFrames);
  std::vector<std::uint64_t> frames;
  std::vector<LightMoment> moments;
  for (std::uint64_t frame = 0; frame < plan.frames; frame += step) {
    if (!go_on(static_cast<double>(frame) / static_cast<double>(plan.frames))) return fail(Errc::kCancelled, "stopped");
    NODAL_TRY_ASSIGN(LightMoment moment, measure(plan, programs, *heads, frame));
    frames.push_back(frame);
    moments.push_back(std::move(moment));
  }
  plan.light = light_of(frames, moments);
  for (std::size_t h = 0; h < plan.light.stops.size(); ++h) {
    const auto [least, most] = std::ranges::minmax(plan.light.stops[h]);
    if (std::max(-least, most) < kSeen * kStop) continue;
    notes.push_back(fmt::format(
        "{}: it is {:+.2f} to {:+.2f} stops brighter than the mean of the heads, which are matched; --light "
        "fixed leaves them as they are",
        plan.heads[h].film.path, 1.0 * least / kStop, 1.0 * most / kStop));
  }
  return {};
}

}  // namespace nodal::film
