#include "stitch/registration/pyramid.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "stitch/geometry/lens.h"
#include "stitch/geometry/response.h"

namespace nodal::registration {
namespace {

Plane make_plane(int width, int height) {
  return {width, height, std::vector<float>(static_cast<std::size_t>(width) * static_cast<std::size_t>(height))};
}

// Red, green and blue of a row, whatever the picture's format, 0..255.
class RowReader {
 public:
  explicit RowReader(const ImageView& image) : image_(image) {
    for (std::size_t c = 0; c < 3; ++c) grids_[c] = component_grid(image.format, static_cast<int>(c) < count() ? static_cast<int>(c) : 0);
  }
  int count() const { return component_count(image_.format); }
  float component(int c, int i, int j) const {
    const PlaneView& plane = image_.planes[static_cast<std::size_t>(c)];
    const PlaneGrid& grid = grids_[static_cast<std::size_t>(c)];
    const int x = std::min(i / grid.step_x, plane.width - 1), y = std::min(j / grid.step_y, plane.height - 1);
    return plane.data[y * plane.row_stride + x * plane.pixel_stride];
  }
  bool is_rgb() const { return image_.format == PixelFormat::kRgb24; }
  float luminance(int i, int j) const {
    if (!is_rgb()) return component(0, i, j);
    return 0.299F * component(0, i, j) + 0.587F * component(1, i, j) + 0.114F * component(2, i, j);
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

// The place of the region that is nearest to a pixel's centre, as a pixel.
std::pair<int, int> nearest_inside(const Region& region, int i, int j, int width, int height) {
  double x = i + 0.5, y = j + 0.5;
  for (int round = 0; round < 3; ++round) {
    if (region.circle) {
      const double dx = x - region.circle->x, dy = y - region.circle->y, r = std::hypot(dx, dy);
      const double most = std::max(0.0, region.circle->radius - 1);
      if (r > most) {
        x = region.circle->x + dx / r * most;
        y = region.circle->y + dy / r * most;
      }
    }
    x = std::clamp(x, region.left + 0.5, region.right - 0.5);
    y = std::clamp(y, region.top + 0.5, region.bottom - 0.5);
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

// One pass of an odd, symmetric filter along x, transposed on the way out; twice is both ways.
void filter_transposed(const Plane& in, const std::vector<float>& taps, Plane& out) {
  const int radius = static_cast<int>(taps.size()) - 1;
  std::vector<float> row(static_cast<std::size_t>(in.width + 2 * radius)), result(static_cast<std::size_t>(in.width));
  for (int j = 0; j < in.height; ++j) {
    const float* source = &in.values[static_cast<std::size_t>(j) * static_cast<std::size_t>(in.width)];
    float* const middle = row.data() + radius;
    for (int i = -radius; i < in.width + radius; ++i) middle[i] = source[std::clamp(i, 0, in.width - 1)];
    for (int i = 0; i < in.width; ++i) result[static_cast<std::size_t>(i)] = taps[0] * middle[i];
    for (int k = 1; k <= radius; ++k) {
      const float tap = taps[static_cast<std::size_t>(k)];
      for (int i = 0; i < in.width; ++i) result[static_cast<std::size_t>(i)] += tap * (middle[i - k] + middle[i + k]);
    }
    for (int i = 0; i < in.width; ++i) {
      out.values[static_cast<std::size_t>(i) * static_cast<std::size_t>(in.height) + static_cast<std::size_t>(j)] =
          result[static_cast<std::size_t>(i)];
    }
  }
}

}  // namespace

std::vector<Plane> light_of(const ImageView& image, const HeadCalibration& head, int channels) {
  const RowReader reader(image);
  const bool linear = head.response.curve == Response::Curve::kLinear;
  // A finer table than 8 bits, since luminance of three bytes is no byte.
  std::array<float, 1021> light{};
  for (std::size_t k = 0; k < light.size(); ++k) {
    light[k] = static_cast<float>(255 * geometry::decode(head.response, static_cast<double>(k) / 1020));
  }
  std::vector<Plane> planes;
  for (int c = 0; c < channels; ++c) {
    Plane plane = make_plane(image.width, image.height);
    std::size_t k = 0;
    for (int j = 0; j < image.height; ++j) {
      for (int i = 0; i < image.width; ++i, ++k) {
        const float encoded = channels == 1 ? reader.luminance(i, j) : reader.channel(c, i, j);
        plane.values[k] = linear ? encoded : light[static_cast<std::size_t>(std::clamp(encoded, 0.0F, 255.0F) * 4)];
      }
    }
    fill_outside(plane, head.region);
    planes.push_back(std::move(plane));
  }
  return planes;
}

Plane halved(const Plane& plane) {
  // Binomial [1 5 10 10 5 1] / 32 both ways, between the pixels.
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
  Plane turned = make_plane(plane.height, plane.width), out = make_plane(plane.width, plane.height);
  filter_transposed(plane, taps, turned);
  filter_transposed(turned, taps, out);
  return out;
}

double level_variance(int level) {
  double variance = 1.0 / 12;
  for (int k = 0; k < level; ++k) variance = (variance + 5.0 / 4) / 4;
  return variance + 1.0 / 6;
}

namespace {

// A picture's px a radian squared, along the radius and across it, by radius: what one cone of rays is on it.
class Stretch {
 public:
  explicit Stretch(const HeadState& head) : edge_(head.edge_radius) {
    const Result<geometry::Lens> lens = geometry::Lens::make(head.lens, head.max_angle);
    for (int k = 0; k <= kSteps; ++k) {
      const double r = lens ? std::min(edge_ * std::max(k, 1) / kSteps, lens->max_radius()) : 1;
      const double a = lens ? lens->angle(r).value_or(head.edge_angle) : 1, q = r / std::sin(a);
      const double slope = lens ? lens->slope(a, r) : 1;
      along_.push_back(slope * slope);
      across_.push_back(q * q);
    }
  }
  double along(double r) const { return along_[index(r)]; }
  double across(double r) const { return across_[index(r)]; }
  double mean() const {
    double sum = 0;
    for (std::size_t k = 0; k < along_.size(); ++k) sum += along_[k] + across_[k];
    return sum / 2 / static_cast<double>(along_.size());
  }

 private:
  static constexpr int kSteps = 256;
  std::size_t index(double r) const { return static_cast<std::size_t>(std::min(r / edge_, 1.0) * kSteps); }
  double edge_;
  std::vector<double> along_, across_;
};

}  // namespace

Plane blurred_in_angle(const Plane& plane, int level, const HeadState& head, double sigma_rad) {
  const double scale = 1 << level, there = level_variance(level);
  const double sigma2 = sigma_rad * sigma_rad / (scale * scale);
  const Stretch stretch(head);
  const double base = std::max(sigma2 * stretch.mean() - there, 0.16), already = there + base;
  const Plane smooth = blurred(plane, std::sqrt(base));
  Plane out = smooth;
  const std::ptrdiff_t w = plane.width;
  for (int j = 1; j + 1 < plane.height; ++j) {
    const double y = ((j + 0.5) * scale - head.center_y) / head.aspect;
    const float* p = smooth.values.data() + j * w + 1;
    float* target = out.values.data() + j * w + 1;
    for (int i = 1; i + 1 < plane.width; ++i, ++p, ++target) {
      const double x = (i + 0.5) * scale - head.center_x, r2 = x * x + y * y + 1e-9;
      const double r = std::sqrt(r2), across = stretch.across(r), extra = (stretch.along(r) - across) / r2;
      const double cxx = sigma2 * (across + extra * x * x) - already, cxy = sigma2 * extra * x * y * head.aspect,
                   cyy = sigma2 * (across + extra * y * y) * head.aspect * head.aspect - already;
      const float xx = p[1] - 2 * p[0] + p[-1], yy = p[w] - 2 * p[0] + p[-w];
      const float xy = (p[w + 1] - p[w - 1] - p[1 - w] + p[-w - 1]) / 4;
      *target += static_cast<float>(cxx) / 2 * xx + static_cast<float>(cxy) * xy + static_cast<float>(cyy) / 2 * yy;
    }
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
    for (const Plane& plane : finer) coarser.push_back(halved(plane));
    pyramid.levels.push_back(std::move(coarser));
  }
  return pyramid;
}

}  // namespace nodal::registration
