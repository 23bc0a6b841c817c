#include "tests/reference/score.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <vector>

namespace nodal::test {
namespace {

double level(const PlaneView& plane, int x, int y) {
  return plane.data[y * plane.row_stride + std::ptrdiff_t{x} * plane.pixel_stride];
}

double luma(const ImageView& rgb, int x, int y) {
  return 0.299 * level(rgb.planes[0], x, y) + 0.587 * level(rgb.planes[1], x, y) + 0.114 * level(rgb.planes[2], x, y);
}

double block_ssim(const ImageView& a, const ImageView& b, int x0, int y0, int side) {
  double sum_a = 0, sum_b = 0, aa = 0, bb = 0, ab = 0;
  for (int y = y0; y < y0 + side; ++y) {
    for (int x = x0; x < x0 + side; ++x) {
      const double va = luma(a, x, y);
      const double vb = luma(b, x, y);
      sum_a += va;
      sum_b += vb;
      aa += va * va;
      bb += vb * vb;
      ab += va * vb;
    }
  }
  const double n = side * side;
  const double mean_a = sum_a / n;
  const double mean_b = sum_b / n;
  const double c1 = 0.01 * 255 * 0.01 * 255;
  const double c2 = 0.03 * 255 * 0.03 * 255;
  return (2 * mean_a * mean_b + c1) * (2 * (ab / n - mean_a * mean_b) + c2) /
         ((mean_a * mean_a + mean_b * mean_b + c1) * (aa / n - mean_a * mean_a + bb / n - mean_b * mean_b + c2));
}

}  // namespace

Score score(const ImageView& raymap, const ImageView& truth, const geometry::RaymapLayout& layout) {
  const auto components = static_cast<std::size_t>(component_count(raymap.format));
  std::vector<double> weight;
  double covered = 0;
  double sphere = 0;
  for (int y = 0; y < raymap.height; ++y) {
    for (int x = 0; x < raymap.width; ++x) {
      const double omega = layout.solid_angle(x, y);
      bool light = false;
      for (std::size_t c = 0; c < components; ++c) light |= level(raymap.planes[c], x, y) > 0;
      weight.push_back(light ? omega : 0);
      covered += weight.back();
      sphere += omega;
    }
  }
  double squares = 0;
  for (std::size_t c = 0; c < components; ++c) {
    double got_got = 0;
    double got_true = 0;
    double true_true = 0;
    std::size_t i = 0;
    for (int y = 0; y < raymap.height; ++y) {
      for (int x = 0; x < raymap.width; ++x, ++i) {
        const double got = level(raymap.planes[c], x, y);
        const double want = level(truth.planes[c], x, y);
        got_got += weight[i] * got * got;
        got_true += weight[i] * got * want;
        true_true += weight[i] * want * want;
      }
    }
    squares += true_true - got_true * got_true / got_got;  // the rest after the best gain
  }
  const double mean = squares / (static_cast<double>(components) * covered);
  return {10 * std::log10(255.0 * 255.0 / mean), covered / sphere};
}

double ssim(const ImageView& a, const ImageView& b, const geometry::RaymapLayout& layout) {
  constexpr int kSide = 8;
  double sum = 0;
  double sphere = 0;
  for (int y = 0; y + kSide <= a.height; y += kSide) {
    for (int x = 0; x + kSide <= a.width; x += kSide) {
      const double omega = layout.solid_angle(x + kSide / 2, y + kSide / 2);
      sum += omega * block_ssim(a, b, x, y, kSide);
      sphere += omega;
    }
  }
  return sum / sphere;
}

Difference difference(std::span<const std::uint8_t> a, std::span<const std::uint8_t> b) {
  Difference result;
  double squares = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    const int d = std::abs(a[i] - b[i]);
    squares += d * d;
    result.largest = std::max(result.largest, d);
    result.differing += d != 0 ? 1 : 0;
  }
  result.psnr_db = 10 * std::log10(255.0 * 255.0 * static_cast<double>(a.size()) / squares);
  return result;
}

}  // namespace nodal::test
