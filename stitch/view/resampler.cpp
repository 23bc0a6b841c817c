#include "stitch/view/resampler.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "stitch/view/tangent.h"

namespace nodal::view {
namespace {

using geometry::Pixel;
using geometry::Ray;

/// Neighbouring pixels of the target whose positions are farther apart, px, lie on both sides of an edge.
constexpr double kEdge = 64;

}  // namespace

Target Target::of(const geometry::RaymapLayout& layout) {
  const double mean = 4 * std::numbers::pi / layout.width() / layout.height();
  return {layout.width(), layout.height(), [&layout](double x, double y) { return layout.ray(x, y); },
          layout.scattered() ? mean : 0, layout.smooth()};
}

Resampler::Resampler(const geometry::RaymapLayout& layout, Filter filter, const parallel::Workers& workers)
    : layout_(layout),
      taps_(Taps::of(filter)),
      filter_(filter),
      pieces_(layout, workers),
      sampler_(layout, pieces_, filter) {}

/// A cell that is sampled pixel by pixel, with the positions of its pixels and of those around them.
template <class Sample>
class Resampler::Square {
 public:
  Square(const Resampler& resampler, const ImageView& raymap, const Target& target, RowKernelOf<Sample> kernel,
         int left, int top)
      : resampler_(resampler),
        plane_(raymap.planes[0]),
        target_(target),
        channels_(component_count(raymap.format)),
        kernel_(kernel),
        left_(left),
        top_(top) {}

  void run(std::uint8_t* into) {
    const int right = std::min(left_ + Cell::kSide, target_.width),
              bottom = std::min(top_ + Cell::kSide, target_.height);
    const int more = target_.pixel_sr > 0 ? 0 : 1;
    for (int y = std::max(0, top_ - more); y < std::min(bottom + more, target_.height); ++y) {
      for (int x = std::max(0, left_ - more); x < std::min(right + more, target_.width); ++x) {
        at(x, y) = position(x + 0.5, y + 0.5);
      }
    }
    for (int y = top_; y < bottom; ++y) {
      for (int x = left_; x < right; ++x) {
        write(x, y, into + (static_cast<std::ptrdiff_t>(y) * target_.width + x) * plane_.pixel_stride);
      }
    }
  }

 private:
  static constexpr int kAround = Cell::kSide + 2;
  Position& at(int x, int y) { return positions_[static_cast<std::size_t>((y - top_ + 1) * kAround + x - left_ + 1)]; }
  Position position(double x, double y) const {
    const std::optional<Ray> ray = target_.ray(x, y);
    const std::optional<Pixel> pixel = ray ? resampler_.layout_.pixel(*ray) : std::nullopt;
    return pixel ? Position{pixel->x, pixel->y} : Position{};
  }
  /// How the position changes across the pixel, px, along rows (1, 0) or columns (0, 1). Nothing if it does not change
  /// about evenly: then the pixel is at an edge between faces.
  std::optional<Eigen::Vector2d> step(int x, int y, int dx, int dy) {
    const auto mean = [&](const Position& before, const Position& behind) -> std::optional<Eigen::Vector2d> {
      const Eigen::Vector2d to_it = apart(before, at(x, y)), from_it = apart(at(x, y), behind);
      const double uneven = (from_it - to_it).norm(), most = std::max(0.5, 0.1 * (from_it.norm() + to_it.norm()));
      if (!(uneven < most) || from_it.norm() > kEdge) return std::nullopt;  // NaN, too
      return (from_it + to_it) / 2;
    };
    if (const auto between_neighbours = mean(at(x - dx, y - dy), at(x + dx, y + dy))) return between_neighbours;
    const double left = x + 0.5 - 0.25 * dx, top = y + 0.5 - 0.25 * dy;
    const auto within = mean(position(left, top), position(left + 0.5 * dx, top + 0.5 * dy));
    return within ? std::optional<Eigen::Vector2d>(4 * *within) : std::nullopt;
  }
  Eigen::Vector2d apart(const Position& from, const Position& to) const {
    Eigen::Vector2d difference(to.x - from.x, to.y - from.y);
    if (resampler_.pieces_.wraps()) {
      const double width = resampler_.layout_.width();
      difference.x() -= width * std::round(difference.x() / width);
    }
    return difference;
  }
  /// Writes a pixel whose samples are all in one piece of the raymap: in integers, at positions that are linear within
  /// the pixel. False, and nothing done, for others.
  bool write_inside(int x, int y, std::uint8_t* to) {
    if (target_.pixel_sr > 0 || resampler_.layout_.scattered()) return false;
    const std::optional<Eigen::Vector2d> across = step(x, y, 1, 0), down = step(x, y, 0, 1);
    if (!across || !down) return false;
    const Taps& taps = resampler_.taps_;
    const int columns = taps.count == 1 ? 1 : samples_for(across->norm());
    const int rows = taps.count == 1 ? 1 : samples_for(down->norm());
    const Eigen::Vector2d right = *across / columns, below = *down / rows;
    const Eigen::Vector2d middle = Eigen::Vector2d(at(x, y).x, at(x, y).y).array() - taps.shift();
    const Eigen::Vector2d reach = ((columns - 1) * right.cwiseAbs() + (rows - 1) * below.cwiseAbs()) / 2;
    const Eigen::Array2i base = middle.array().floor().cast<int>();
    const Eigen::Array2i least = (middle - reach).array().floor().cast<int>() - 1 - taps.before;
    const Eigen::Array2i most = (middle + reach).array().floor().cast<int>() + 1 + taps.count - taps.before;
    if (!resampler_.pieces_.all_joined(least.x(), least.y(), most.x() + kLoadedBeyond, most.y())) return false;
    const std::uint8_t* origin =
        plane_.data + base.y() * plane_.row_stride + static_cast<std::ptrdiff_t>(base.x()) * plane_.pixel_stride;
    std::array<typename Samples<Sample>::Scaled, 3 * Cell::kMaxSamples + 3> samples;
    std::array<int, 3> sums{};
    for (int row = 0; row < rows; ++row) {
      const Eigen::Vector2d first =
          middle - base.cast<double>().matrix() + (row - 0.5 * (rows - 1)) * below - 0.5 * (columns - 1) * right;
      kernel_(
          origin, plane_.row_stride, taps,
          {Curve::fixed(first.x()), Curve::fixed(right.x()), 0, Curve::fixed(first.y()), Curve::fixed(right.y()), 0},
          columns, samples.data());
      for (int k = 0; k < columns; ++k) {
        for (int c = 0; c < channels_; ++c) {
          sums[static_cast<std::size_t>(c)] += samples[static_cast<std::size_t>(k * channels_ + c)];
        }
      }
    }
    for (std::size_t c = 0; c < static_cast<std::size_t>(channels_); ++c) {
      store(mean_level<Sample>(sums[c], columns * rows), to + c * sizeof(Sample));
    }
    return true;
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
    return samples_for(std::sqrt(square));
  }
  void write(int x, int y, std::uint8_t* to) {
    const Position middle = at(x, y);
    std::fill(to, to + plane_.pixel_stride, std::uint8_t{0});
    if (std::isnan(middle.x) || write_inside(x, y, to)) return;
    const auto middle_ray = [&] { return *target_.ray(x + 0.5, y + 0.5); };
    // In scattered raymaps, whose pixels lie anywhere, one sample takes all that is near.
    const int n = resampler_.filter_ == Filter::kNearest || resampler_.layout_.scattered() ? 1 : samples(x, y);
    Sum<Sample> sum;
    int count = 0;
    if (n == 1) {
      resampler_.sampler_.add(plane_, channels_, middle, std::cref(middle_ray), sum);
      count = 1;
    }
    const Ray own_ray = n > 1 ? middle_ray() : Ray();
    const double reach = n > 1 ? 2 * (n + 1) * resampler_.sampler_.pitch_at(middle) : 0;
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
      resampler_.sampler_.add(plane_, channels_, {pixel->x, pixel->y}, std::cref(its_ray), sum);
      ++count;
    }
    using Real = typename Sum<Sample>::Real;
    for (int c = 0; c < channels_ && count > 0; ++c) {
      const Real level = sum.value[c] / static_cast<Real>(count) + Real{0.5F};
      store(static_cast<Sample>(std::clamp(level, Real{0}, Real{Samples<Sample>::kMax})),
            to + static_cast<std::size_t>(c) * sizeof(Sample));
    }
  }

  const Resampler& resampler_;
  const PlaneView& plane_;
  const Target& target_;
  const int channels_;
  const RowKernelOf<Sample> kernel_;
  const int left_, top_;
  std::array<Position, kAround * kAround> positions_;
};

Resampler::Plan Resampler::plan(const Target& target, const parallel::Workers& workers) const {
  const int columns = (target.width + Cell::kSide - 1) / Cell::kSide;
  const int rows = (target.height + Cell::kSide - 1) / Cell::kSide;
  Plan plan{target, columns, std::vector<std::optional<Cell>>(static_cast<std::size_t>(columns * rows))};
  if (!target.smooth || !layout_.smooth()) return plan;
  workers.run(rows, [&](int row) {
    for (int column = 0; column < columns; ++column) {
      plan.cells[static_cast<std::size_t>(row * columns + column)] =
          Cell::make(target, layout_, pieces_, taps_, column * Cell::kSide, row * Cell::kSide);
    }
  });
  return plan;
}

template <class Sample>
DecodedImage Resampler::resample_as(const ImageView& raymap, const Plan& plan, const parallel::Workers& workers) const {
  const int channels = component_count(raymap.format);
  const Target& target = plan.target;
  const int pixel = channels * static_cast<int>(sizeof(Sample));
  NODAL_ASSERT(raymap.width == layout_.width() && raymap.height == layout_.height());
  NODAL_ASSERT(raymap.planes[0].pixel_stride == pixel);
  DecodedImage made{raymap.format, target.width, target.height, {}};
  made.bytes.resize(packed_size(made.format, made.width, made.height));
  const RowKernelOf<Sample> kernel = row_kernel<Sample>(channels, taps_);
  const std::ptrdiff_t stride = static_cast<std::ptrdiff_t>(pixel) * target.width;
  workers.run(static_cast<int>(plan.cells.size()) / std::max(1, plan.columns), [&](int row) {
    for (int column = 0; column < plan.columns; ++column) {
      const std::optional<Cell>& cell = plan.cells[static_cast<std::size_t>(row * plan.columns + column)];
      const int left = column * Cell::kSide, top = row * Cell::kSide;
      if (cell) {
        cell->write<Sample>(raymap.planes[0], channels, taps_, kernel, made.bytes.data() + top * stride + left * pixel,
                            stride);
      } else {
        Square<Sample>(*this, raymap, target, kernel, left, top).run(made.bytes.data());
      }
    }
  });
  return made;
}

DecodedImage Resampler::resample(const ImageView& raymap, const Plan& plan, const parallel::Workers& workers) const {
  const PixelFormat format = in_8_bits(raymap.format);
  NODAL_ASSERT(format == PixelFormat::kGrey8 || format == PixelFormat::kRgb24);
  return is_linear16(raymap.format) ? resample_as<std::uint16_t>(raymap, plan, workers)
                                    : resample_as<std::uint8_t>(raymap, plan, workers);
}

}  // namespace nodal::view
