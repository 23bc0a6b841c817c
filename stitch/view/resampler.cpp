#include "stitch/view/resampler.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
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

struct Weights {
  int first;
  int count;
  std::array<float, 4> of;
};

/// The taps along one axis for a position in pixels whose centres are whole numbers.
Weights taps(Filter filter, double at) {
  const double floor = std::floor(at);
  const auto t = static_cast<float>(at - floor);
  const int first = static_cast<int>(floor);
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
          layout.scattered() ? mean : 0};
}

Resampler::Resampler(const geometry::RaymapLayout& layout, Filter filter, const parallel::Workers& workers)
    : layout_(layout), filter_(filter), wraps_(false) {
  if (layout.scattered() || filter == Filter::kNearest) return;
  const double middle = 0.5 * layout.height();
  const std::optional<Ray> left = layout.ray(0, middle), right = layout.ray(layout.width(), middle);
  const std::optional<Ray> top_left = layout.ray(0, 0.5), top_right = layout.ray(layout.width(), 0.5);
  wraps_ = left && right && top_left && top_right && geometry::angle_between(*left, *right) < 1e-9 &&
           geometry::angle_between(*top_left, *top_right) < 1e-9;
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
    const auto across = [&](int i, int j) { return meet(i + 1 - 1e-6, j + 0.5, i + 1 + 1e-6, j + 0.5, i, j); };
    const auto below = [&](int i, int j) { return meet(i + 0.5, j + 1 - 1e-6, i + 0.5, j + 1 + 1e-6, i, j); };
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

void Resampler::add_pixel(const PlaneView& plane, int channels, int i, int j, float weight, Sum& sum) const {
  const std::uint8_t* at = plane.data + j * plane.row_stride + i * plane.pixel_stride;
  for (int c = 0; c < channels; ++c) sum.value[c] += weight * static_cast<float>(at[c]);
}

/// The pixels that hold the nearest rays of nine about this one, half a pixel apart, each with a weight that falls to 0
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
  const double pitch = std::sqrt(angle > 0 ? angle : 4 * std::numbers::pi / layout_.width() / layout_.height());
  const Tangent tangent = tangent_at(ray);
  std::array<std::pair<int, int>, 9> found;
  std::size_t count = 0;
  float total = 0;
  Sum weighted;
  for (int k = 0; k < 9; ++k) {
    const double x = 0.5 * (k % 3 - 1) * pitch, y = 0.5 * (k / 3 - 1) * pitch;
    const std::pair<int, int> pixel = pixel_of(Ray::towards(ray.direction() + x * tangent.right + y * tangent.down));
    if (pixel.first < 0 || std::find(found.begin(), found.begin() + count, pixel) != found.begin() + count) continue;
    found[count++] = pixel;
    const std::optional<Ray> its = layout_.ray(pixel.first + 0.5, pixel.second + 0.5);
    if (!its) continue;
    const double dx = its->direction().dot(tangent.right) / pitch, dy = its->direction().dot(tangent.down) / pitch;
    const auto weight = static_cast<float>(std::max(0.0, 1 - std::abs(dx)) * std::max(0.0, 1 - std::abs(dy)));
    add_pixel(plane, channels, pixel.first, pixel.second, weight, weighted);
    total += weight;
  }
  if (total < 1e-3F) return add_pixel(plane, channels, own.first, own.second, 1, sum);
  for (int c = 0; c < channels; ++c) sum.value[c] += weighted.value[c] / total;
}

void Resampler::add(const PlaneView& plane, int channels, const Ray& ray, const Pixel& at, Sum& sum) const {
  if (filter_ == Filter::kNearest) {
    const int i = std::clamp(static_cast<int>(at.x), 0, layout_.width() - 1);
    return add_pixel(plane, channels, i, std::clamp(static_cast<int>(at.y), 0, layout_.height() - 1), 1, sum);
  }
  if (layout_.scattered()) return add_across_edge(plane, channels, ray, sum);
  const int i = static_cast<int>(std::floor(at.x - 0.5)), j = static_cast<int>(std::floor(at.y - 0.5));
  Filter filter = filter_;
  if (filter == Filter::kBicubic && !smooth(i, j, 1)) filter = Filter::kBilinear;
  if (filter == Filter::kBilinear && !smooth(i, j, 0)) return add_across_edge(plane, channels, ray, sum);
  const Weights x = taps(filter, at.x - 0.5), y = taps(filter, at.y - 0.5);
  const int width = layout_.width();
  for (int b = 0; b < y.count; ++b) {
    for (int a = 0; a < x.count; ++a) {
      int column = x.first + a;
      if (wraps_) column = column < 0 ? column + width : column >= width ? column - width : column;
      add_pixel(plane, channels, column, y.first + b,
                x.of[static_cast<std::size_t>(a)] * y.of[static_cast<std::size_t>(b)], sum);
    }
  }
}

/// One row of the target after the other, with the positions of the next.
class Resampler::Rows {
 public:
  Rows(const Resampler& resampler, const ImageView& raymap, const Target& target, int channels)
      : resampler_(resampler), plane_(raymap.planes[0]), target_(target), channels_(channels) {}

  void run(int begin, int end, std::uint8_t* into) {
    locate(begin);
    for (int y = begin; y < end; ++y) {
      std::swap(row_, next_);
      locate(y + 1);
      for (int x = 0; x < target_.width; ++x) write(x, y, into + (y * target_.width + x) * channels_);
    }
  }

 private:
  struct Place {
    std::optional<Ray> ray;
    std::optional<Pixel> at;
  };

  Place place(double x, double y) const {
    Place place{target_.ray(x, y), std::nullopt};
    if (place.ray) place.at = resampler_.layout_.pixel(*place.ray);
    return place;
  }
  void locate(int y) {
    next_.assign(static_cast<std::size_t>(target_.width), {});
    if (y >= target_.height) return;
    for (int x = 0; x < target_.width; ++x) next_[static_cast<std::size_t>(x)] = place(x + 0.5, y + 0.5);
  }
  /// Samples along each side of the target's pixel.
  int samples(int x) const {
    const std::size_t k = static_cast<std::size_t>(x);
    double scale = 0;
    if (target_.pixel_sr > 0) {
      const Pixel& at = *row_[k].at;
      const double own =
          resampler_.layout_.solid_angle(std::clamp(static_cast<int>(at.x), 0, resampler_.layout_.width() - 1),
                                         std::clamp(static_cast<int>(at.y), 0, resampler_.layout_.height() - 1));
      scale = own > 0 ? std::sqrt(target_.pixel_sr / own) : 1;
    } else {
      const auto compare = [&](const Place& other) {
        if (!other.at) return;
        const double apart = std::hypot(other.at->x - row_[k].at->x, other.at->y - row_[k].at->y);
        if (apart < kEdge) scale = std::max(scale, apart);
      };
      if (k + 1 < row_.size()) compare(row_[k + 1]);
      if (k > 0) compare(row_[k - 1]);
      compare(next_[k]);
    }
    return std::clamp(static_cast<int>(scale + 0.7), 1, kMostSamples);
  }
  void write(int x, int y, std::uint8_t* to) const {
    const Place& middle = row_[static_cast<std::size_t>(x)];
    std::fill(to, to + channels_, std::uint8_t{0});
    if (!middle.at) return;
    // Of scattered raymaps, whose pixels lie anywhere, one sample takes all that is near.
    const int n = resampler_.filter_ == Filter::kNearest || resampler_.layout_.scattered() ? 1 : samples(x);
    Sum sum;
    int count = 0;
    if (n == 1) {
      resampler_.add(plane_, channels_, *middle.ray, *middle.at, sum);
      count = 1;
    }
    for (int k = 0; n > 1 && k < n * n; ++k) {
      const double dx = (k % n + 0.5) / n - 0.5, dy = (k / n + 0.5) / n - 0.5;
      Place sample;
      if (target_.pixel_sr > 0) {
        const Tangent tangent = tangent_at(*middle.ray);
        const double side = std::sqrt(target_.pixel_sr);
        sample.ray = Ray::towards(middle.ray->direction() + side * (dx * tangent.right + dy * tangent.down));
        sample.at = resampler_.layout_.pixel(*sample.ray);
      } else {
        sample = place(x + 0.5 + dx, y + 0.5 + dy);
      }
      if (!sample.at) continue;
      resampler_.add(plane_, channels_, *sample.ray, *sample.at, sum);
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
  std::vector<Place> row_, next_;
};

DecodedImage Resampler::resample(const ImageView& raymap, const Target& target,
                                 const parallel::Workers& workers) const {
  const int channels = component_count(raymap.format);
  NODAL_ASSERT(raymap.width == layout_.width() && raymap.height == layout_.height());
  NODAL_ASSERT(raymap.format == PixelFormat::kRgb24 || raymap.format == PixelFormat::kGrey8);
  DecodedImage made{raymap.format, target.width, target.height, {}};
  made.bytes.resize(packed_size(made.format, made.width, made.height));
  workers.run((target.height + kBandRows - 1) / kBandRows, [&](int band) {
    Rows rows(*this, raymap, target, channels);
    rows.run(band * kBandRows, std::min((band + 1) * kBandRows, target.height), made.bytes.data());
  });
  return made;
}

}  // namespace nodal::view
