#include "stitch/calibration/lens/scale_space.h"

#include <algorithm>
#include <cmath>
#include <cstring>

namespace nodal::calibration {
namespace {

constexpr int kSmallestLevel = 16;  // px

/// taps[k] weighs the sample at offset first + k.
struct Kernel {
  int first = 0;
  std::vector<float> taps;
};

/// A Gaussian centred at `center`, sampled at integers, with sum one.
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

/// Convolves the rows and keeps every `step`th sample.
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
    for (int k = 0; k < count; ++k) {
      const float tap = kernel.taps[static_cast<std::size_t>(k)];
      const float* from = padded.data() + (kernel.first + k + count);
      for (int i = 0; i < out.width; ++i) to[i] += tap * from[i * step];
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

using Four [[gnu::vector_size(4 * sizeof(float))]] = float;

float sum_of(Four f) { return (f[0] + f[1]) + (f[2] + f[3]); }

/// Catmull-Rom: the weights of the four samples around a position t beyond the second, and their derivatives.
struct Cubic {
  Four weight;
  Four slope;
  explicit Cubic(float t) {
    constexpr Four c0{0, 1, 0, 0}, c1{-0.5F, 0, 0.5F, 0}, c2{1, -2.5F, 2, -0.5F}, c3{-0.5F, 1.5F, -1.5F, 0.5F};
    weight = c0 + t * (c1 + t * (c2 + t * c3));
    slope = c1 + t * (2 * c2 + t * (3 * c3));
  }
};

/// Value and slopes, still separate for each of four columns.
struct Point {
  Four value, dx, dy;
};

Point sample_level(const GreyImage& image, double x, double y) {
  // The indices of the four samples; a point more than four samples outside the picture is moved to four outside.
  constexpr int kOff = 5;
  const double u = std::clamp(x - 0.5, -4.0, image.width + 4.0) + (kOff - 1);
  const double v = std::clamp(y - 0.5, -4.0, image.height + 4.0) + (kOff - 1);
  const int below_u = static_cast<int>(u), below_v = static_cast<int>(v);
  const Cubic across(static_cast<float>(u - below_u));
  const Cubic down(static_cast<float>(v - below_v));
  const int i0 = below_u - kOff;
  const int j0 = below_v - kOff;
  const bool inside = i0 >= 0 && i0 + 4 <= image.width;
  Four values{};
  Four slopes{};
  for (int k = 0; k < 4; ++k) {
    const float* row = image.row(std::clamp(j0 + k, 0, image.height - 1));
    Four samples;
    if (inside) {
      std::memcpy(&samples, row + i0, sizeof samples);
    } else {
      for (int n = 0; n < 4; ++n) samples[n] = row[std::clamp(i0 + n, 0, image.width - 1)];
    }
    values += down.weight[k] * samples;
    slopes += down.slope[k] * samples;
  }
  return {across.weight * values, across.slope * values, across.weight * slopes};
}

}  // namespace

GreyImage blurred(const GreyImage& image, double sigma) {
  const Kernel kernel = gaussian(sigma, 0);
  return filter_columns(filter_rows(image, kernel, 1), kernel, 1);
}

GreyImage halved(const GreyImage& image) {
  // From a blur of kLevelSigma in these pixels to kLevelSigma in pixels twice as large; a new sample is between two old
  // ones.
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
  const auto share = static_cast<float>(scale - static_cast<double>(fine));
  const double fine_px = 1.0 / static_cast<double>(std::size_t{1} << fine);
  const double coarse_px = 1.0 / static_cast<double>(std::size_t{1} << coarse);
  const Point a = sample_level(levels_[fine], x * fine_px, y * fine_px);
  const Point b = sample_level(levels_[coarse], x * coarse_px, y * coarse_px);
  const float of_fine = (1 - share) * static_cast<float>(fine_px), of_coarse = share * static_cast<float>(coarse_px);
  Sample s;
  s.value = static_cast<double>(sum_of((1 - share) * a.value + share * b.value));
  s.dx = static_cast<double>(sum_of(of_fine * a.dx + of_coarse * b.dx));
  s.dy = static_cast<double>(sum_of(of_fine * a.dy + of_coarse * b.dy));
  s.dscale = static_cast<double>(sum_of(b.value - a.value));
  return s;
}

}  // namespace nodal::calibration
