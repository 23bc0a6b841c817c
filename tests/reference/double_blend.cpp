#include "tests/reference/double_blend.h"

#include <algorithm>
#include <cmath>

namespace nodal::test {
namespace {

double black_of(PixelFormat format, int c) { return has_chroma(format) && c > 0 ? 128.0 : 0.0; }

/// A plane in double precision, sharpened by TableOptions::sharpen without rounding.
struct RealSource {
  int width = 0;
  int height = 0;
  std::vector<double> values;
  double at(int x, int y) const { return values[static_cast<std::size_t>(y * width + x)]; }
};

RealSource sharpened(const PlaneView& plane, int sharpen) {
  const auto at = [&](int i, int j) -> double {
    const int x = std::clamp(i, 0, plane.width - 1);
    const int y = std::clamp(j, 0, plane.height - 1);
    return plane.data[y * plane.row_stride + std::ptrdiff_t{x} * plane.pixel_stride];
  };
  RealSource source{plane.width, plane.height, {}};
  for (int y = 0; y < plane.height; ++y) {
    for (int x = 0; x < plane.width; ++x) {
      const double detail = 4 * at(x, y) - at(x - 2, y) - at(x + 2, y) - at(x, y - 2) - at(x, y + 2);
      source.values.push_back(std::clamp(at(x, y) + sharpen * detail / 64, 0.0, 255.0));
    }
  }
  return source;
}

double bilinear(const RealSource& plane, double x, double y) {
  const int x0 = std::min(static_cast<int>(x), plane.width - 2);
  const int y0 = std::min(static_cast<int>(y), plane.height - 2);
  const double a = x - x0;
  const double b = y - y0;
  return (plane.at(x0, y0) * (1 - a) + plane.at(x0 + 1, y0) * a) * (1 - b) +
         (plane.at(x0, y0 + 1) * (1 - a) + plane.at(x0 + 1, y0 + 1) * a) * b;
}

}  // namespace

std::vector<RealPlane> blend_in_double(const table::RaySampler& sampler, std::span<const ImageView> heads) {
  const PixelFormat format = sampler.raymap_format();
  table::RowSampler row(sampler);
  std::vector<RealPlane> planes;
  for (int c = 0; c < component_count(format); ++c) {
    const int g = has_chroma(format) && c > 0 ? 1 : 0;
    const table::RaySampler::Grid& grid = sampler.grids()[static_cast<std::size_t>(g)];
    RealPlane plane{grid.width, grid.height, {}, {}};
    const std::size_t colour = in_8_bits(format) == PixelFormat::kRgb24 ? static_cast<std::size_t>(c) : 0;
    const double black = black_of(format, c);
    std::vector<RealSource> sources;
    for (const ImageView& head : heads) {
      sources.push_back(sharpened(halved_chroma(head).planes[static_cast<std::size_t>(c)], sampler.options().sharpen));
    }
    for (int y = 0; y < grid.height; ++y) {
      row.sample(g, y);
      for (int x = 0; x < grid.width; ++x) {
        double value = black;
        for (const table::RaySample& s : row.at(x)) {
          const double gain = std::min(s.gain * sampler.optics()[s.head].gain[colour], 32767.0 / 4096);
          value += s.weight * gain * (bilinear(sources[s.head], s.x, s.y) - black);
        }
        plane.values.push_back(value);
        plane.covered.push_back(!row.at(x).empty());
      }
    }
    planes.push_back(std::move(plane));
  }
  return planes;
}

std::vector<std::uint8_t> round_to_levels(PixelFormat format, int width, int height,
                                          const std::vector<RealPlane>& planes) {
  std::vector<std::uint8_t> bytes(packed_size(format, width, height));
  const MutableImageView image = packed_image(format, width, height, bytes.data());
  for (std::size_t c = 0; c < planes.size(); ++c) {
    const MutablePlaneView& out = image.planes[c];
    for (int y = 0; y < out.height; ++y) {
      for (int x = 0; x < out.width; ++x) {
        const double value = planes[c].values[static_cast<std::size_t>(y * out.width + x)];
        out.data[y * out.row_stride + std::ptrdiff_t{x} * out.pixel_stride] =
            static_cast<std::uint8_t>(std::clamp(std::floor(value + 0.5), 0.0, 255.0));
      }
    }
  }
  return bytes;
}

}  // namespace nodal::test
