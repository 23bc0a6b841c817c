#include "stitch/registration/pyramid.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "stitch/geometry/lens/lens.h"
#include "stitch/geometry/response.h"
#include "stitch/registration/wide.h"

namespace nodal::registration {
namespace {

Plane make_plane(int width, int height) {
  return {width, height, std::vector<float>(static_cast<std::size_t>(width) * static_cast<std::size_t>(height))};
}

// Red, green and blue of a row, whatever the picture's format, 0..255.
class RowReader {
 public:
  explicit RowReader(const ImageView& image) : image_(image) {
    for (std::size_t c = 0; c < 3; ++c)
      grids_[c] = component_grid(image.format, static_cast<int>(c) < count() ? static_cast<int>(c) : 0);
  }
  int count() const { return component_count(image_.format); }
  float component(int c, int i, int j) const {
    const PlaneView& plane = image_.planes[static_cast<std::size_t>(c)];
    const PlaneGrid& grid = grids_[static_cast<std::size_t>(c)];
    const int x = std::min(i / grid.step_x, plane.width - 1), y = std::min(j / grid.step_y, plane.height - 1);
    return plane.data[y * plane.row_stride + x * plane.pixel_stride];
  }
  bool is_rgb() const { return image_.format == PixelFormat::kRgb24; }
  // Writes the luminance of every pixel of row j.
  void luminances(int j, float* into) const {
    const PlaneView& plane = image_.planes[0];  // the first component has a sample for every pixel
    const std::uint8_t* from = plane.data + j * plane.row_stride;
    if (is_rgb()) {
      for (int i = 0; i < image_.width; ++i, from += plane.pixel_stride) {  // less than 0 in a turned picture
        into[i] = 0.299F * static_cast<float>(from[0]) + 0.587F * static_cast<float>(from[1]) +
                  0.114F * static_cast<float>(from[2]);
      }
      return;
    }
    for (int i = 0; i < image_.width; ++i, from += plane.pixel_stride) into[i] = *from;
  }
  float channel(int c, int i, int j) const {
    if (is_rgb()) return component(c, i, j);
    const float y = component(0, i, j);
    if (count() == 1) return y;
    const float cb = component(1, i, j) - 128, cr = component(2, i, j) - 128;
    const std::array<float, 3> rgb{y + 1.402F * cr, y - 0.344136F * cb - 0.714136F * cr, y + 1.772F * cb};
    return std::clamp(rgb[static_cast<std::size_t>(c)], 0.0F, 255.0F);
  }

 private:
  const ImageView& image_;
  std::array<PlaneGrid, 3> grids_;
};

// The pixel of the region that is nearest to a pixel's centre.
std::pair<int, int> nearest_inside(const Region& region, int i, int j, int width, int height) {
  double x = i + 0.5, y = j + 0.5;
  for (int round = 0; round < 3; ++round) {
    const double before_x = x, before_y = y;
    if (region.circle) {
      const double dx = x - region.circle->x, dy = y - region.circle->y, square = dx * dx + dy * dy;
      const double most = std::max(0.0, region.circle->radius - 1);
      if (square > most * most) {
        const double r = std::sqrt(square);
        x = region.circle->x + dx / r * most;
        y = region.circle->y + dy / r * most;
      }
    }
    x = std::clamp(x, region.left + 0.5, region.right - 0.5);
    y = std::clamp(y, region.top + 0.5, region.bottom - 0.5);
    if (x == before_x && y == before_y) break;
  }
  return {std::clamp(static_cast<int>(x), 0, width - 1), std::clamp(static_cast<int>(y), 0, height - 1)};
}

void fill_outside(Plane& plane, const Region& region) {
  const bool whole = !region.circle && region.left <= 0 && region.top <= 0 && region.right >= plane.width &&
                     region.bottom >= plane.height;
  if (whole) return;
  const std::vector<float> source = plane.values;
  for (int j = 0; j < plane.height; ++j) {
    for (int i = 0; i < plane.width; ++i) {
      const auto [x, y] = nearest_inside(region, i, j, plane.width, plane.height);
      if (x == i && y == j) continue;
      plane.values[static_cast<std::size_t>(j) * static_cast<std::size_t>(plane.width) + static_cast<std::size_t>(i)] =
          source[static_cast<std::size_t>(y) * static_cast<std::size_t>(plane.width) + static_cast<std::size_t>(x)];
    }
  }
}

// Adds tap * (a + b), element by element.
NODAL_WIDE
void add_tapped(float tap, const float* a, const float* b, int count, float* sum) {
  for (int i = 0; i < count; ++i) sum[i] += tap * (a[i] + b[i]);
}

// A symmetric filter: the middle tap, then those on either side. Edge pixels are repeated.
void filter_across(const Plane& in, const std::vector<float>& taps, Plane& out) {
  const int radius = static_cast<int>(taps.size()) - 1;
  std::vector<float> row(static_cast<std::size_t>(in.width + 2 * radius));
  for (int j = 0; j < in.height; ++j) {
    const float* source = in.values.data() + std::ptrdiff_t{j} * in.width;
    float* const target = out.values.data() + std::ptrdiff_t{j} * in.width;
    float* const middle = row.data() + radius;
    for (int i = -radius; i < in.width + radius; ++i) middle[i] = source[std::clamp(i, 0, in.width - 1)];
    for (int i = 0; i < in.width; ++i) target[i] = taps[0] * middle[i];
    for (int k = 1; k <= radius; ++k) {
      add_tapped(taps[static_cast<std::size_t>(k)], middle - k, middle + k, in.width, target);
    }
  }
}

void filter_down(const Plane& in, const std::vector<float>& taps, Plane& out) {
  const auto row = [&](int j) { return in.values.data() + std::ptrdiff_t{std::clamp(j, 0, in.height - 1)} * in.width; };
  for (int j = 0; j < in.height; ++j) {
    float* const target = out.values.data() + std::ptrdiff_t{j} * in.width;
    for (int i = 0; i < in.width; ++i) target[i] = taps[0] * row(j)[i];
    for (int k = 1; k < static_cast<int>(taps.size()); ++k) {
      add_tapped(taps[static_cast<std::size_t>(k)], row(j - k), row(j + k), in.width, target);
    }
  }
}

}  // namespace

std::vector<Plane> light_of(const ImageView& image, const HeadCalibration& head, int channels) {
  const RowReader reader(image);
  const bool linear = head.response.curve == Response::Curve::kLinear;
  // More than 256 entries, because the luminance of three bytes is not an integer.
  std::array<float, 1021> light{};
  for (std::size_t k = 0; k < light.size(); ++k) {
    light[k] = static_cast<float>(255 * geometry::decode(head.response, static_cast<double>(k) / 1020));
  }
  std::vector<Plane> planes;
  for (int c = 0; c < channels; ++c) {
    Plane plane = make_plane(image.width, image.height);
    for (int j = 0; j < image.height; ++j) {
      float* const row = plane.values.data() + std::ptrdiff_t{j} * image.width;
      if (channels == 1) {
        reader.luminances(j, row);
      } else {
        for (int i = 0; i < image.width; ++i) row[i] = reader.channel(c, i, j);
      }
      if (linear) continue;
      for (int i = 0; i < image.width; ++i) {
        row[i] = light[static_cast<std::size_t>(std::clamp(row[i], 0.0F, 255.0F) * 4)];
      }
    }
    fill_outside(plane, head.region);
    planes.push_back(std::move(plane));
  }
  return planes;
}

Plane halved(const Plane& plane) {
  // Binomial filter [1 5 10 10 5 1] / 32 along rows and columns, centred between pixels.
  constexpr std::array<float, 6> kTaps{1.0F / 32, 5.0F / 32, 10.0F / 32, 10.0F / 32, 5.0F / 32, 1.0F / 32};
  const int w = plane.width / 2, h = plane.height / 2;
  Plane out = make_plane(w, h);
  std::vector<float> column(static_cast<std::size_t>(plane.width) + 6);
  for (int j = 0; j < h; ++j) {
    std::ranges::fill(column, 0.0F);
    float* const middle = column.data() + 2;
    for (int k = 0; k < 6; ++k) {
      const int y = std::clamp(2 * j + k - 2, 0, plane.height - 1);
      const float* source = &plane.values[static_cast<std::size_t>(y) * static_cast<std::size_t>(plane.width)];
      const float tap = kTaps[static_cast<std::size_t>(k)];
      for (int i = 0; i < plane.width; ++i) middle[i] += tap * source[i];
    }
    middle[-2] = middle[-1] = middle[0];
    for (int i = plane.width; i < plane.width + 4; ++i) middle[i] = middle[plane.width - 1];
    float* const target = &out.values[static_cast<std::size_t>(j) * static_cast<std::size_t>(w)];
    for (int i = 0; i < w; ++i) {
      float sum = 0;
      for (int k = 0; k < 6; ++k) sum += kTaps[static_cast<std::size_t>(k)] * middle[2 * i + k - 2];
      target[i] = sum;
    }
  }
  return out;
}

Plane blurred(const Plane& plane, double sigma) {
  if (sigma <= 0) return plane;
  const int radius = std::max(1, static_cast<int>(std::ceil(3 * sigma)));
  std::vector<float> taps;
  double sum = 0;
  for (int k = 0; k <= radius; ++k) {
    const double tap = std::exp(-0.5 * k * k / (sigma * sigma));
    taps.push_back(static_cast<float>(tap));
    sum += k == 0 ? tap : 2 * tap;
  }
  for (float& tap : taps) tap = static_cast<float>(tap / sum);
  Plane across = make_plane(plane.width, plane.height), out = make_plane(plane.width, plane.height);
  filter_across(plane, taps, across);
  filter_down(across, taps, out);
  return out;
}

double level_variance(int level) {
  double variance = 1.0 / 12;
  for (int k = 0; k < level; ++k) variance = (variance + 5.0 / 4) / 4;
  return variance + 1.0 / 6;
}

namespace {

// The squared px per radian of a picture, by distance from the lens's centre: the size of a cone of rays in it.
class Stretch {
 public:
  static constexpr int kSteps = 256;  // equal steps of the squared radius

  explicit Stretch(const HeadState& head) : per_step_(kSteps / (head.edge_radius * head.edge_radius)) {
    const Result<geometry::Lens> lens = geometry::Lens::make(head.lens, head.max_angle);
    double radii = 0;
    for (int k = 0; k < kSteps; ++k) {
      const double at = std::sqrt((k + 0.5) / per_step_), r = lens ? std::min(at, lens->max_radius()) : 1;
      const double a = lens ? lens->angle(r).value_or(head.edge_angle) : 1, q = r / std::sin(a);
      const double slope = lens ? lens->slope(a, r) : 1;
      across_.push_back(q * q);
      extra_.push_back((slope * slope - q * q) / (at * at));
      // Weights of 1 / radius: the mean is then over equal steps of the radius.
      mean_ += (slope * slope + q * q) / 2 / at;
      radii += 1 / at;
    }
    mean_ /= radii;
  }
  /// Perpendicular to the radius.
  const std::vector<double>& across() const { return across_; }
  /// The excess along the radius, divided by the squared radius.
  const std::vector<double>& extra() const { return extra_; }
  double per_step() const { return per_step_; }
  double mean() const { return mean_; }

 private:
  double per_step_;
  std::vector<double> across_, extra_;
  double mean_ = 0;
};

// The missing second moments of a row's pixels, as factors of second derivatives.
struct Lack {
  std::array<float, Stretch::kSteps> across, extra;
  float per_step, aspect, already;
};

// x: distance of the row's first pixel from the centre, full-size px; pixels are `scale` apart. y: divided by the
// aspect.
NODAL_WIDE
void put_right(const Lack& lack, const float* p, std::ptrdiff_t w, int count, float x0, float scale, float y,
               float* out) {
  const float aspect = lack.aspect, aspect2 = aspect * aspect, y2 = y * y;
  for (int i = 0; i < count; ++i) {
    const float x = x0 + scale * static_cast<float>(i), x2 = x * x, step = (x2 + y2) * lack.per_step;
    const int k = static_cast<int>(std::min(step, static_cast<float>(Stretch::kSteps - 1)));
    const float across = lack.across[static_cast<std::size_t>(k)], extra = lack.extra[static_cast<std::size_t>(k)];
    const float cxx = across + extra * x2 - lack.already, cyy = (across + extra * y2) * aspect2 - lack.already;
    const float xx = p[i + 1] - 2 * p[i] + p[i - 1], yy = p[i + w] - 2 * p[i] + p[i - w];
    const float xy = p[i + w + 1] - p[i + w - 1] - p[i + 1 - w] + p[i - w - 1];
    out[i] += cxx * xx + cyy * yy + extra * x * y * aspect * 0.5F * xy;
  }
}

}  // namespace

Plane blurred_in_angle(const Plane& plane, int level, const HeadState& head, double sigma_rad) {
  const double scale = 1 << level, own_variance = level_variance(level);
  const double sigma2 = sigma_rad * sigma_rad / (scale * scale);
  const Stretch stretch(head);
  const double base = std::max(sigma2 * stretch.mean() - own_variance, 0.16), already = own_variance + base;
  const Plane smooth = blurred(plane, std::sqrt(base));
  Lack lack;  // halved, because a blur adds half its second moment times the second derivative
  for (std::size_t k = 0; k < lack.across.size(); ++k) {
    lack.across[k] = static_cast<float>(sigma2 * stretch.across()[k] / 2);
    lack.extra[k] = static_cast<float>(sigma2 * stretch.extra()[k] / 2);
  }
  lack.per_step = static_cast<float>(stretch.per_step());
  lack.aspect = static_cast<float>(head.aspect);
  lack.already = static_cast<float>(already / 2);
  Plane out = smooth;
  const std::ptrdiff_t w = plane.width;
  for (int j = 1; j + 1 < plane.height; ++j) {
    const double y = ((j + 0.5) * scale - head.center_y) / head.aspect;
    put_right(lack, smooth.values.data() + j * w + 1, w, plane.width - 2,
              static_cast<float>(1.5 * scale - head.center_x), static_cast<float>(scale), static_cast<float>(y),
              out.values.data() + j * w + 1);
  }
  return out;
}

HeadPyramid make_pyramid(std::vector<Plane> planes, int smallest) {
  HeadPyramid pyramid;
  pyramid.levels.push_back(std::move(planes));
  while (static_cast<int>(pyramid.levels.size()) < kLevels) {
    const std::vector<Plane>& finer = pyramid.levels.back();
    if (std::min(finer.front().width, finer.front().height) / 2 < smallest) break;
    std::vector<Plane> coarser;
    coarser.reserve(finer.size());
    for (const Plane& plane : finer) coarser.push_back(halved(plane));
    pyramid.levels.push_back(std::move(coarser));
  }
  return pyramid;
}

}  // namespace nodal::registration
