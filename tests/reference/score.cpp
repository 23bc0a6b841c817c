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
    squares += true_true - got_true * got_true / got_got;  // what the best gain leaves
  }
  const double mean = squares / (static_cast<double>(components) * covered);
  return {10 * std::log10(255.0 * 255.0 / mean), covered / sphere};
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
