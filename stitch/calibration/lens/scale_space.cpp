#include "stitch/calibration/lens/scale_space.h"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>

namespace nodal::calibration {
namespace {

constexpr int kSmallestLevel = 16;  // px

/// taps[k] weighs the sample at offset first + k.
struct Kernel {
  int first = 0;
  std::vector<float> taps;
};

/// Samples of a Gaussian centred at `center` (in samples), summing to one.
Kernel gaussian(double sigma, double center) {
  const double reach = 4 * sigma;
  Kernel kernel;
  kernel.first = static_cast<int>(std::ceil(center - reach));
  double sum = 0;
  std::vector<double> taps;
  for (int i = kernel.first; i <= center + reach; ++i) {
    taps.push_back(std::exp(-0.5 * (i - center) * (i - center) / (sigma * sigma)));
    sum += taps.back();
  }
  for (const double tap : taps) kernel.taps.push_back(static_cast<float>(tap / sum));
  return kernel;
}

/// Every `step`th sample of the rows, convolved.
GreyImage filter_rows(const GreyImage& in, const Kernel& kernel, int step) {
  GreyImage out(in.width / step, in.height);
  const int last = in.width - 1;
  const int count = static_cast<int>(kernel.taps.size());
  std::vector<float> padded(static_cast<std::size_t>(in.width + 2 * count));
  for (int j = 0; j < in.height; ++j) {
    const float* row = in.row(j);
    for (int i = -count; i <= last + count; ++i) {
      padded[static_cast<std::size_t>(i + count)] = row[std::clamp(i, 0, last)];
    }
    float* to = out.row(j);
    for (int i = 0; i < out.width; ++i) {
      const float* from = padded.data() + (i * step + kernel.first + count);
      float sum = 0;
      for (int k = 0; k < count; ++k) sum += kernel.taps[static_cast<std::size_t>(k)] * from[k];
      to[i] = sum;
    }
  }
  return out;
}

GreyImage filter_columns(const GreyImage& in, const Kernel& kernel, int step) {
  GreyImage out(in.width, in.height / step);
  const int last = in.height - 1;
  for (int j = 0; j < out.height; ++j) {
    float* to = out.row(j);
    for (std::size_t k = 0; k < kernel.taps.size(); ++k) {
      const float tap = kernel.taps[k];
      const float* from = in.row(std::clamp(j * step + kernel.first + static_cast<int>(k), 0, last));
      for (int i = 0; i < in.width; ++i) to[i] += tap * from[i];
    }
  }
  return out;
}

/// Catmull-Rom: weights of the four samples about a place that is t past the second, and their derivatives.
struct Cubic {
  Eigen::Array4f weight;
  Eigen::Array4f slope;
  explicit Cubic(float t) {
    const float t2 = t * t;
    const float t3 = t2 * t;
    weight << -0.5F * t3 + t2 - 0.5F * t, 1.5F * t3 - 2.5F * t2 + 1, -1.5F * t3 + 2 * t2 + 0.5F * t,
        0.5F * t3 - 0.5F * t2;
    slope << -1.5F * t2 + 2 * t - 0.5F, 4.5F * t2 - 5 * t, -4.5F * t2 + 4 * t + 0.5F, 1.5F * t2 - t;
  }
};

/// Value and slopes from the columns (each one's four samples) already weighed down the rows.
struct Point {
  float value, dx, dy;
};

Point sample_level(const GreyImage& image, double x, double y) {
  const double u = std::clamp(x - 0.5, -4.0, image.width + 4.0);
  const double v = std::clamp(y - 0.5, -4.0, image.height + 4.0);
  const double floor_u = std::floor(u);
  const double floor_v = std::floor(v);
  const Cubic across(static_cast<float>(u - floor_u));
  const Cubic down(static_cast<float>(v - floor_v));
  const int i0 = static_cast<int>(floor_u) - 1;
  const int j0 = static_cast<int>(floor_v) - 1;
  const bool inside = i0 >= 0 && i0 + 4 <= image.width;
  Eigen::Array4f values = Eigen::Array4f::Zero();
  Eigen::Array4f slopes = Eigen::Array4f::Zero();
  for (int k = 0; k < 4; ++k) {
    const float* row = image.row(std::clamp(j0 + k, 0, image.height - 1));
    Eigen::Array4f samples;
    if (inside) {
      samples = Eigen::Map<const Eigen::Array4f>(row + i0);
    } else {
      for (int n = 0; n < 4; ++n) samples[n] = row[std::clamp(i0 + n, 0, image.width - 1)];
    }
    values += down.weight[k] * samples;
    slopes += down.slope[k] * samples;
  }
  return {(across.weight * values).sum(), (across.slope * values).sum(), (across.weight * slopes).sum()};
}

}  // namespace

GreyImage blurred(const GreyImage& image, double sigma) {
  const Kernel kernel = gaussian(sigma, 0);
  return filter_columns(filter_rows(image, kernel, 1), kernel, 1);
}

GreyImage halved(const GreyImage& image) {
  // From kLevelSigma of these pixels to kLevelSigma of pixels twice as large; the new sample lies between two
  // old.
  static const Kernel kernel = gaussian(kLevelSigma * std::sqrt(3.0), 0.5);
  return filter_columns(filter_rows(image, kernel, 2), kernel, 2);
}

ScaleSpace::ScaleSpace(const GreyImage& image) {
  levels_.push_back(blurred(image, kLevelSigma));
  while (std::min(levels_.back().width, levels_.back().height) >= 2 * kSmallestLevel) {
    levels_.push_back(halved(levels_.back()));
  }
}

ScaleSpace::Sample ScaleSpace::at(double x, double y, double sigma) const {
  const double scale = std::clamp(std::log2(sigma / kLevelSigma), 0.0, static_cast<double>(levels_.size() - 1));
  const auto fine = std::min(static_cast<std::size_t>(scale), levels_.size() - 1);
  const std::size_t coarse = std::min(fine + 1, levels_.size() - 1);
  const double share = scale - static_cast<double>(fine);
  const double fine_px = 1.0 / static_cast<double>(std::size_t{1} << fine);
  const double coarse_px = 1.0 / static_cast<double>(std::size_t{1} << coarse);
  const Point a = sample_level(levels_[fine], x * fine_px, y * fine_px);
  const Point b = sample_level(levels_[coarse], x * coarse_px, y * coarse_px);
  const auto between = [share](float from, float to) {
    return (1 - share) * static_cast<double>(from) + share * static_cast<double>(to);
  };
  Sample s;
  s.value = between(a.value, b.value);
  s.dx = between(a.dx * static_cast<float>(fine_px), b.dx * static_cast<float>(coarse_px));
  s.dy = between(a.dy * static_cast<float>(fine_px), b.dy * static_cast<float>(coarse_px));
  s.dscale = static_cast<double>(b.value) - static_cast<double>(a.value);
  return s;
}

}  // namespace nodal::calibration
