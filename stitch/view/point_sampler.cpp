#include "stitch/view/point_sampler.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <optional>
#include <utility>

#include "stitch/view/natural_neighbours.h"
#include "stitch/view/tangent.h"

namespace nodal::view {
namespace {

using geometry::Pixel;
using geometry::Ray;

template <class Sample>
void add_sample(const std::uint8_t* at, int channels, typename Sum<Sample>::Real weight, Sum<Sample>& sum) {
  const auto level = [at](std::size_t c) {
    return static_cast<typename Sum<Sample>::Real>(load<Sample>(at + c * sizeof(Sample)));
  };
  sum.value[0] += weight * level(0);
  if (channels == 1) return;
  sum.value[1] += weight * level(1);
  sum.value[2] += weight * level(2);
}

template <class Sample>
void add_pixel(const PlaneView& plane, int channels, int i, int j, typename Sum<Sample>::Real weight,
               Sum<Sample>& sum) {
  add_sample(plane.data + j * plane.row_stride + i * plane.pixel_stride, channels, weight, sum);
}

}  // namespace

PointSampler::PointSampler(const geometry::RaymapLayout& layout, const Pieces& pieces, Filter filter)
    : layout_(layout),
      scattered_(dynamic_cast<const geometry::ScatteredRays*>(&layout)),
      pieces_(pieces),
      filter_(filter),
      mean_sr_(4 * std::numbers::pi / layout.width() / layout.height()) {}

/// How far neighbouring rays are apart, rad; at least the mean over the raymap.
double PointSampler::pitch_at(const Position& at) const {
  const int i = std::clamp(static_cast<int>(at.x), 0, layout_.width() - 1);
  const int j = std::clamp(static_cast<int>(at.y), 0, layout_.height() - 1);
  return std::sqrt(std::max(layout_.solid_angle(i, j), mean_sr_));
}

/// The pixels that hold the nearest rays of nine about this one, three quarters of a pixel apart, each with a weight
/// that falls to 0 one pixel away along longitude and latitude: bilinear if rows follow the latitude.
template <class Sample>
void PointSampler::add_across_edge(const PlaneView& plane, int channels, const Ray& ray, Sum<Sample>& sum) const {
  using Real = typename Sum<Sample>::Real;
  const auto pixel_of = [&](const Ray& towards) {
    const std::optional<Pixel> at = layout_.pixel(towards);
    if (!at) return std::pair(-1, -1);
    return std::pair(std::clamp(static_cast<int>(at->x), 0, layout_.width() - 1),
                     std::clamp(static_cast<int>(at->y), 0, layout_.height() - 1));
  };
  const std::pair<int, int> own = pixel_of(ray);
  if (own.first < 0) return;
  const double angle = layout_.solid_angle(own.first, own.second);
  const double pitch = std::sqrt(angle > 0 ? angle : mean_sr_);
  const Tangent tangent = tangent_at(ray);
  std::array<std::pair<int, int>, 9> found;
  std::size_t count = 0;
  Real total = 0;
  Sum<Sample> weighted;
  double nearest = 10;
  std::pair<int, int> closest = own;
  for (int k = 0; k < 9; ++k) {
    const double x = 0.75 * (k % 3 - 1) * pitch, y = 0.75 * (k / 3 - 1) * pitch;
    const std::pair<int, int> pixel = pixel_of(Ray::towards(ray.direction() + x * tangent.right + y * tangent.down));
    if (pixel.first < 0 || std::find(found.begin(), found.begin() + count, pixel) != found.begin() + count) continue;
    found[count++] = pixel;
    const std::optional<Ray> its = layout_.ray(pixel.first + 0.5, pixel.second + 0.5);
    if (!its) continue;
    const double dx = its->direction().dot(tangent.right) / pitch, dy = its->direction().dot(tangent.down) / pitch;
    const double away = (its->direction() - ray.direction()).squaredNorm();
    if (away < nearest) nearest = away, closest = pixel;
    if (away > 4 * pitch * pitch) continue;  // a ray of another face in a pixel that an edge crosses
    const auto weight = static_cast<Real>(std::max(0.0, 1 - std::abs(dx)) * std::max(0.0, 1 - std::abs(dy)));
    add_pixel(plane, channels, pixel.first, pixel.second, weight, weighted);
    total += weight;
  }
  if (total < Real{1e-3F} || filter_ == Filter::kNearest) {
    return add_pixel(plane, channels, closest.first, closest.second, 1, sum);
  }
  for (int c = 0; c < channels; ++c) sum.value[c] += weighted.value[c] / total;
}

template <class Sample>
void PointSampler::add_natural(const PlaneView& plane, int channels, const Ray& ray, Sum<Sample>& sum) const {
  for (const Neighbour& neighbour : natural_neighbours(*scattered_, ray)) {
    add_pixel(plane, channels, neighbour.i, neighbour.j, static_cast<typename Sum<Sample>::Real>(neighbour.weight),
              sum);
  }
}

template <class Sample>
void PointSampler::add(const PlaneView& plane, int channels, const Position& at, const std::function<Ray()>& ray,
                       Sum<Sample>& sum) const {
  using Real = typename Sum<Sample>::Real;
  const int width = layout_.width();
  if (filter_ == Filter::kNearest) {
    const int i = std::clamp(static_cast<int>(at.x), 0, width - 1);
    const int j = std::clamp(static_cast<int>(at.y), 0, layout_.height() - 1);
    const std::optional<Ray> its = layout_.ray(i + 0.5, j + 0.5);
    if (its && (its->direction() - ray().direction()).norm() < Pieces::kFar * pitch_at(at))
      return add_pixel(plane, channels, i, j, 1, sum);
    return add_across_edge(plane, channels, ray(), sum);
  }
  if (scattered_ != nullptr) return add_natural(plane, channels, ray(), sum);
  // Phases are rounded down in 8 bits, and to the nearest in 16.
  constexpr bool kDeep = sizeof(Sample) > 1;
  const double shift = kDeep ? Taps::of(filter_).shift() : 0.5;
  const double left = at.x - shift, top = at.y - shift;
  const int i = static_cast<int>(left + 1) - 1, j = static_cast<int>(top + 1) - 1;  // rounded down: both are over -1
  const auto phase = [](double part) { return static_cast<std::size_t>(part * Taps::kPhases); };
  // The centre of a pixel, also at an edge, gives the pixel.
  if (kDeep && phase(left - i) == 0 && phase(top - j) == 0) return add_pixel(plane, channels, i, j, 1, sum);
  Filter filter = filter_;
  if (filter != Filter::kBilinear && !pieces_.joined(i, j, Taps::of(filter).before)) filter = Filter::kBilinear;
  if (filter == Filter::kBilinear && !pieces_.joined(i, j, 0)) return add_across_edge(plane, channels, ray(), sum);
  const Taps& taps = Taps::of(filter);
  const auto& phases = Samples<Sample>::phases(taps);
  const auto &across = phases[phase(left - i)], &down = phases[phase(top - j)];
  constexpr Real kOne = Samples<Sample>::kOne, kScale = 1 / (kOne * kOne);
  for (int b = 0; b < taps.count; ++b) {
    const std::uint8_t* row = plane.data + (j - taps.before + b) * plane.row_stride;
    for (int a = 0; a < taps.count; ++a) {
      int column = i - taps.before + a;
      if (column < 0 || column >= width) column = (column % width + width) % width;
      add_sample<Sample>(row + column * plane.pixel_stride, channels,
                         kScale * static_cast<Real>(std::int64_t{across[static_cast<std::size_t>(a)]} *
                                                    down[static_cast<std::size_t>(b)]),
                         sum);
    }
  }
}

template void PointSampler::add<std::uint8_t>(const PlaneView&, int, const Position&, const std::function<Ray()>&,
                                              Sum<std::uint8_t>&) const;
template void PointSampler::add<std::uint16_t>(const PlaneView&, int, const Position&, const std::function<Ray()>&,
                                               Sum<std::uint16_t>&) const;

}  // namespace nodal::view
