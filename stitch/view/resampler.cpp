#include "stitch/view/resampler.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <string>
#include <utility>

namespace nodal::view {
namespace {

using geometry::Pixel;
using geometry::Ray;

constexpr int kBandRows = 16;
/// Neighbouring pixels of the target whose positions are farther apart, px, lie on both sides of an edge.
constexpr double kEdge = 64;
/// Positions are computed for the corners of cells of so many pixels, and interpolated where that is exact enough.
constexpr int kCell = 8;
constexpr double kSamePlace = 1.0 / 64;  // px of the raymap

/// Rays of neighbouring pixels that are farther apart, in pixels, belong to different faces.
constexpr double kFar = 5;

struct Weights {
  int first;
  int count;
  std::array<float, 4> of;
};

/// The taps along one axis for a position `t`, 0..1, behind pixel `first`.
Weights taps(Filter filter, int first, float t) {
  if (filter == Filter::kBilinear) return {first, 2, {1 - t, t}};
  const float t2 = t * t, t3 = t2 * t;
  return {first - 1,
          4,
          {0.5F * (-t3 + 2 * t2 - t), 0.5F * (3 * t3 - 5 * t2 + 2), 0.5F * (-3 * t3 + 4 * t2 + t), 0.5F * (t3 - t2)}};
}

struct Tangent {
  Eigen::Vector3d right, down;
};

/// Directions of longitude and latitude at a ray; any at the poles.
Tangent tangent_at(const Ray& ray) {
  const double across = std::hypot(ray.x(), ray.z());
  const Eigen::Vector3d right =
      across > 1e-12 ? Eigen::Vector3d(ray.z() / across, 0, -ray.x() / across) : Eigen::Vector3d(1, 0, 0);
  return {right, ray.direction().cross(right)};
}

}  // namespace

Result<Filter> parse_filter(std::string_view text) {
  if (text == "nearest") return Filter::kNearest;
  if (text == "bilinear") return Filter::kBilinear;
  if (text == "bicubic") return Filter::kBicubic;
  return fail(Errc::kBadValue,
              "no filter is called '" + std::string(text.substr(0, 64)) + "'; there are: nearest, bilinear, bicubic");
}

Target Target::of(const geometry::RaymapLayout& layout) {
  const double mean = 4 * std::numbers::pi / layout.width() / layout.height();
  return {layout.width(), layout.height(), [&layout](double x, double y) { return layout.ray(x, y); },
          layout.scattered() ? mean : 0, false};
}

Resampler::Resampler(const geometry::RaymapLayout& layout, Filter filter, const parallel::Workers& workers)
    : layout_(layout),
      filter_(filter),
      wraps_(false),
      mean_sr_(4 * std::numbers::pi / layout.width() / layout.height()) {
  if (layout.scattered() || filter == Filter::kNearest) return;
  wraps_ = true;
  for (const double y : {0.5, 0.3 * layout.height(), 0.5 * layout.height()}) {
    const std::optional<Ray> left = layout.ray(0, y), right = layout.ray(layout.width(), y);
    wraps_ = wraps_ && left && right && geometry::angle_between(*left, *right) < 1e-9;
    for (const double part : {0.1, 0.25, 0.45, 0.8}) {
      const std::optional<Ray> ray = layout.ray(part * layout.width(), y);
      wraps_ = wraps_ && ray && std::abs(ray->y() - left->y()) < 1e-9;
    }
  }
  if (wraps_) return;
  const int width = layout.width(), height = layout.height();
  joined_.assign(static_cast<std::size_t>(width) * static_cast<std::size_t>(height), 0);
  workers.run((height + kBandRows - 1) / kBandRows, [&](int band) {
    // Just on both sides of the edge between two pixels, rays differ by less than a quarter of a pixel.
    const auto meet = [&](double x0, double y0, double x1, double y1, int i, int j) {
      const std::optional<Ray> a = layout_.ray(x0, y0), b = layout_.ray(x1, y1);
      if (!a || !b) return false;
      const double pitch = std::sqrt(layout_.solid_angle(i, j));
      return (a->direction() - b->direction()).norm() < 0.25 * pitch;
    };
    // An edge that crosses both pixels aslant may miss that point, but then their own rays are far apart.
    const auto near = [&](int i, int j, int k, int l) {
      const std::optional<Ray> a = layout_.ray(i + 0.5, j + 0.5), b = layout_.ray(k + 0.5, l + 0.5);
      return a && b && (a->direction() - b->direction()).norm() < kFar * std::sqrt(layout_.solid_angle(i, j));
    };
    const auto across = [&](int i, int j) {
      return meet(i + 1 - 1e-6, j + 0.5, i + 1 + 1e-6, j + 0.5, i, j) && near(i, j, i + 1, j);
    };
    const auto below = [&](int i, int j) {
      return meet(i + 0.5, j + 1 - 1e-6, i + 0.5, j + 1 + 1e-6, i, j) && near(i, j, i, j + 1);
    };
    for (int j = band * kBandRows; j < std::min((band + 1) * kBandRows, height - 1); ++j) {
      for (int i = 0; i + 1 < width; ++i) {
        const bool all = across(i, j) && across(i, j + 1) && below(i, j) && below(i + 1, j);
        joined_[static_cast<std::size_t>(j) * static_cast<std::size_t>(width) + static_cast<std::size_t>(i)] =
            all ? 1 : 0;
      }
    }
  });
}

/// Whether the pixels (i - reach, j - reach) .. (i + 1 + reach, j + 1 + reach) are one piece.
bool Resampler::smooth(int i, int j, int reach) const {
  if (j - reach < 0 || j + 1 + reach >= layout_.height()) return false;
  if (wraps_) return true;
  if (i - reach < 0 || i + 1 + reach >= layout_.width()) return false;
  for (int y = j - reach; y <= j + reach; ++y) {
    for (int x = i - reach; x <= i + reach; ++x) {
      if (joined_[static_cast<std::size_t>(y) * static_cast<std::size_t>(layout_.width()) +
                  static_cast<std::size_t>(x)] == 0) {
        return false;
      }
    }
  }
  return true;
}

/// How far neighbouring rays are apart, rad; at least the mean over the raymap.
double Resampler::pitch_at(const Position& at) const {
  const int i = std::clamp(static_cast<int>(at.x), 0, layout_.width() - 1);
  const int j = std::clamp(static_cast<int>(at.y), 0, layout_.height() - 1);
  return std::sqrt(std::max(layout_.solid_angle(i, j), mean_sr_));
}

void Resampler::add_sample(const std::uint8_t* at, int channels, float weight, Sum& sum) {
  sum.value[0] += weight * static_cast<float>(at[0]);
  if (channels == 1) return;
  sum.value[1] += weight * static_cast<float>(at[1]);
  sum.value[2] += weight * static_cast<float>(at[2]);
}

void Resampler::add_pixel(const PlaneView& plane, int channels, int i, int j, float weight, Sum& sum) const {
  add_sample(plane.data + j * plane.row_stride + i * plane.pixel_stride, channels, weight, sum);
}

/// The pixels that hold the nearest rays of nine about this one, three quarters of a pixel apart, each with a weight that falls to 0
/// one pixel away along longitude and latitude: bilinear if rows follow the latitude.
void Resampler::add_across_edge(const PlaneView& plane, int channels, const Ray& ray, Sum& sum) const {
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
  float total = 0;
  Sum weighted;
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
    const auto weight = static_cast<float>(std::max(0.0, 1 - std::abs(dx)) * std::max(0.0, 1 - std::abs(dy)));
    add_pixel(plane, channels, pixel.first, pixel.second, weight, weighted);
    total += weight;
  }
  if (total < 1e-3F || filter_ == Filter::kNearest) {
    return add_pixel(plane, channels, closest.first, closest.second, 1, sum);
  }
  for (int c = 0; c < channels; ++c) sum.value[c] += weighted.value[c] / total;
}

void Resampler::add(const PlaneView& plane, int channels, const Position& at, const std::function<Ray()>& ray,
                    Sum& sum) const {
  const int width = layout_.width();
  if (filter_ == Filter::kNearest) {
    const int i = std::clamp(static_cast<int>(at.x), 0, width - 1);
    const int j = std::clamp(static_cast<int>(at.y), 0, layout_.height() - 1);
    const std::optional<Ray> its = layout_.ray(i + 0.5, j + 0.5);
    if (its && (its->direction() - ray().direction()).norm() < kFar * pitch_at(at))
      return add_pixel(plane, channels, i, j, 1, sum);
    return add_across_edge(plane, channels, ray(), sum);
  }
  if (layout_.scattered()) return add_across_edge(plane, channels, ray(), sum);
  const double left = at.x - 0.5, top = at.y - 0.5;
  const int i = static_cast<int>(left + 1) - 1, j = static_cast<int>(top + 1) - 1;  // rounded down: both are over -1
  Filter filter = filter_;
  if (filter == Filter::kBicubic && !smooth(i, j, 1)) filter = Filter::kBilinear;
  if (filter == Filter::kBilinear && !smooth(i, j, 0)) return add_across_edge(plane, channels, ray(), sum);
  const Weights x = taps(filter, i, static_cast<float>(left - i)), y = taps(filter, j, static_cast<float>(top - j));
  const bool inside = x.first >= 0 && x.first + x.count <= width;
  for (int b = 0; b < y.count; ++b) {
    const std::uint8_t* row = plane.data + (y.first + b) * plane.row_stride;
    for (int a = 0; a < x.count; ++a) {
      int column = x.first + a;
      if (!inside) column = (column + width) % width;
      add_sample(row + column * plane.pixel_stride, channels,
                 x.of[static_cast<std::size_t>(a)] * y.of[static_cast<std::size_t>(b)], sum);
    }
  }
}

/// A band of the target's rows, with the positions of their pixels and of those of the row below.
class Resampler::Band {
 public:
  Band(const Resampler& resampler, const ImageView& raymap, const Target& target, int channels)
      : resampler_(resampler), plane_(raymap.planes[0]), target_(target), channels_(channels) {}

  void run(int begin, int end, std::uint8_t* into) {
    begin_ = begin;
    positions_.assign(static_cast<std::size_t>(target_.width) * static_cast<std::size_t>(kBandRows + 1), kNowhere);
    const int last = std::min(end + 1, target_.height);
    for (int y = begin; y < end; y += kCell) {
      for (int x = 0; x < target_.width; x += kCell) {
        locate(x, std::min(x + kCell, target_.width), y, std::min(y + kCell, end), y + kCell < end ? y + kCell : last);
      }
    }
    for (int y = begin; y < end; ++y) {
      for (int x = 0; x < target_.width; ++x) {
        write(x, y, into + (static_cast<std::ptrdiff_t>(y) * target_.width + x) * channels_);
      }
    }
  }

 private:
  Position& at(int x, int y) {
    return positions_[static_cast<std::size_t>(y - begin_) * static_cast<std::size_t>(target_.width) +
                      static_cast<std::size_t>(x)];
  }
  Position position(double x, double y) const {
    const std::optional<Ray> ray = target_.ray(x, y);
    const std::optional<Pixel> pixel = ray ? resampler_.layout_.pixel(*ray) : std::nullopt;
    return pixel ? Position{pixel->x, pixel->y} : kNowhere;
  }
  /// The positions of a cell's pixels: bilinear between its corners' if that is right in its middle. Not where layouts
  /// have faces, whose corners could lie in a cell unnoticed.
  /// Rows `top` to `last` are wanted, of which the one at `bottom` is the next cell's or the next band's.
  void locate(int left, int right, int top, int bottom, int last) {
    if (target_.smooth && resampler_.wraps_ && bottom - top == kCell && right - left == kCell) {
      const Position a = position(left + 0.5, top + 0.5), b = position(right + 0.5, top + 0.5);
      const Position c = position(left + 0.5, bottom + 0.5), d = position(right + 0.5, bottom + 0.5);
      const Position middle = position(left + 0.5 + kCell / 2, top + 0.5 + kCell / 2);
      // NaN fails the comparison, too.
      if (std::abs((a.x + b.x + c.x + d.x) / 4 - middle.x) < kSamePlace &&
          std::abs((a.y + b.y + c.y + d.y) / 4 - middle.y) < kSamePlace) {
        for (int y = top; y < last; ++y) {
          const double v = static_cast<double>(y - top) / kCell;
          const Position from{a.x + v * (c.x - a.x), a.y + v * (c.y - a.y)};
          const Position to{b.x + v * (d.x - b.x), b.y + v * (d.y - b.y)};
          const double dx = (to.x - from.x) / kCell, dy = (to.y - from.y) / kCell;
          for (int k = 0; k < kCell; ++k) {
            at(left + k, y) = {from.x + k * dx, from.y + k * dy};
          }
        }
        return;
      }
    }
    for (int y = top; y < last; ++y) {
      for (int x = left; x < right; ++x) at(x, y) = position(x + 0.5, y + 0.5);
    }
  }
  /// Samples along each side of the target's pixel.
  int samples(int x, int y) {
    const Position own = at(x, y);
    double square = 0;
    if (target_.pixel_sr > 0) {
      const geometry::RaymapLayout& layout = resampler_.layout_;
      const double its = layout.solid_angle(std::clamp(static_cast<int>(own.x), 0, layout.width() - 1),
                                            std::clamp(static_cast<int>(own.y), 0, layout.height() - 1));
      square = its > 0 ? target_.pixel_sr / its : 1;
    } else {
      const auto compare = [&](const Position& other) {
        const double dx = other.x - own.x, dy = other.y - own.y, apart = dx * dx + dy * dy;
        if (apart < kEdge * kEdge && apart > square) square = apart;  // false for NaN
      };
      if (x + 1 < target_.width) compare(at(x + 1, y));
      if (x > 0) compare(at(x - 1, y));
      compare(at(x, y + 1));
    }
    return square < 1.6 ? 1 : std::clamp(static_cast<int>(std::sqrt(square) + 0.7), 1, kMostSamples);
  }
  void write(int x, int y, std::uint8_t* to) {
    const Position middle = at(x, y);
    std::fill(to, to + channels_, std::uint8_t{0});
    if (std::isnan(middle.x)) return;
    const auto middle_ray = [&] { return *target_.ray(x + 0.5, y + 0.5); };
    // Of scattered raymaps, whose pixels lie anywhere, one sample takes all that is near.
    const int n = resampler_.filter_ == Filter::kNearest || resampler_.layout_.scattered() ? 1 : samples(x, y);
    Sum sum;
    int count = 0;
    if (n == 1) {
      resampler_.add(plane_, channels_, middle, std::cref(middle_ray), sum);
      count = 1;
    }
    const Ray own_ray = n > 1 ? middle_ray() : Ray();
    const double reach = n > 1 ? 2 * (n + 1) * resampler_.pitch_at(middle) : 0;
    for (int k = 0; n > 1 && k < n * n; ++k) {
      const double dx = (k % n + 0.5) / n - 0.5, dy = (k / n + 0.5) / n - 0.5;
      std::optional<Ray> ray = target_.ray(x + 0.5 + dx, y + 0.5 + dy);
      if (target_.pixel_sr > 0) {
        const Tangent tangent = tangent_at(*ray);
        const double side = std::sqrt(target_.pixel_sr);
        ray = Ray::towards(ray->direction() + side * (dx * tangent.right + dy * tangent.down));
      }
      // The part of the target's pixel that is in another face shows another place.
      if (ray && (ray->direction() - own_ray.direction()).squaredNorm() > reach * reach) continue;
      const std::optional<Pixel> pixel = ray ? resampler_.layout_.pixel(*ray) : std::nullopt;
      if (!pixel) continue;
      const auto its_ray = [&] { return *ray; };
      resampler_.add(plane_, channels_, {pixel->x, pixel->y}, std::cref(its_ray), sum);
      ++count;
    }
    for (int c = 0; c < channels_ && count > 0; ++c) {
      to[c] = static_cast<std::uint8_t>(std::clamp(sum.value[c] / static_cast<float>(count) + 0.5F, 0.0F, 255.0F));
    }
  }

  const Resampler& resampler_;
  const PlaneView& plane_;
  const Target& target_;
  const int channels_;
  int begin_ = 0;
  std::vector<Position> positions_;
};

DecodedImage Resampler::resample(const ImageView& raymap, const Target& target,
                                 const parallel::Workers& workers) const {
  const int channels = component_count(raymap.format);
  NODAL_ASSERT(raymap.width == layout_.width() && raymap.height == layout_.height());
  NODAL_ASSERT(raymap.format == PixelFormat::kRgb24 || raymap.format == PixelFormat::kGrey8);
  DecodedImage made{raymap.format, target.width, target.height, {}};
  made.bytes.resize(packed_size(made.format, made.width, made.height));
  workers.run((target.height + kBandRows - 1) / kBandRows, [&](int band) {
    Band rows(*this, raymap, target, channels);
    rows.run(band * kBandRows, std::min((band + 1) * kBandRows, target.height), made.bytes.data());
  });
  return made;
}

}  // namespace nodal::view
