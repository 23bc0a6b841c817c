#include <algorithm>
#include <cmath>

#include "stitch/media/image_file.h"

namespace nodal::media {

namespace {

bool is_yuv(PixelFormat f) { return component_count(f) == 3 && f != PixelFormat::kRgb24; }

std::uint8_t rounded(float v) { return static_cast<std::uint8_t>(std::clamp(v + 0.5F, 0.0F, 255.0F)); }

/// The samples of one component, and their positions in the picture.
struct Component {
  int width = 0;
  int height = 0;
  PlaneGrid grid;
  std::vector<float> values;

  /// Bilinear interpolation at a point of the full picture; pixel corners are at integers.
  float at(double u, double v) const {
    const double x = std::clamp(u / grid.step_x + grid.offset_x - 0.5, 0.0, width - 1.0);
    const double y = std::clamp(v / grid.step_y + grid.offset_y - 0.5, 0.0, height - 1.0);
    const auto i = static_cast<std::size_t>(x);
    const auto j = static_cast<std::size_t>(y);
    const std::size_t right = std::min(i + 1, static_cast<std::size_t>(width) - 1);
    const std::size_t below = std::min(j + 1, static_cast<std::size_t>(height) - 1);
    const auto fx = static_cast<float>(x - static_cast<double>(i));
    const auto fy = static_cast<float>(y - static_cast<double>(j));
    const auto w = static_cast<std::size_t>(width);
    const float upper = values[j * w + i] * (1 - fx) + values[j * w + right] * fx;
    const float lower = values[below * w + i] * (1 - fx) + values[below * w + right] * fx;
    return upper * (1 - fy) + lower * fy;
  }
};

Component component_of(const ImageView& image, int c) {
  const PlaneView& plane = image.planes[static_cast<std::size_t>(c)];
  Component component{plane.width, plane.height, component_grid(image.format, c), {}};
  component.values.reserve(static_cast<std::size_t>(plane.width) * static_cast<std::size_t>(plane.height));
  for (int y = 0; y < plane.height; ++y) {
    const std::uint8_t* p = plane.data + y * plane.row_stride;
    for (int x = 0; x < plane.width; ++x, p += plane.pixel_stride) component.values.push_back(*p);
  }
  return component;
}

std::array<Component, 3> components_of(const ImageView& image) {
  std::array<Component, 3> all;
  for (int c = 0; c < component_count(image.format); ++c) all[static_cast<std::size_t>(c)] = component_of(image, c);
  if (component_count(image.format) == 1) {
    // Grey is R = G = B, or Y with neutral chroma; in both cases the other components are copies.
    all[1] = all[2] = all[0];
  }
  return all;
}

/// Full-range BT.601 (JFIF 1.02), in place.
void rgb_to_yuv(std::array<Component, 3>& c) {
  for (std::size_t i = 0; i < c[0].values.size(); ++i) {
    const float r = c[0].values[i];
    const float g = c[1].values[i];
    const float b = c[2].values[i];
    c[0].values[i] = 0.299F * r + 0.587F * g + 0.114F * b;
    c[1].values[i] = -0.168736F * r - 0.331264F * g + 0.5F * b + 128;
    c[2].values[i] = 0.5F * r - 0.418688F * g - 0.081312F * b + 128;
  }
}

std::array<float, 3> yuv_to_rgb(float y, float u, float v) {
  return {y + 1.402F * (v - 128), y - 0.344136F * (u - 128) - 0.714136F * (v - 128), y + 1.772F * (u - 128)};
}

void write(const MutableImageView& into, int c, int x, int y, float value) {
  const MutablePlaneView& plane = into.planes[static_cast<std::size_t>(c)];
  plane.data[y * plane.row_stride + static_cast<std::ptrdiff_t>(x) * plane.pixel_stride] = rounded(value);
}

void write_rgb(const std::array<Component, 3>& from, bool yuv, const MutableImageView& into) {
  for (int y = 0; y < into.height; ++y) {
    for (int x = 0; x < into.width; ++x) {
      const double u = x + 0.5;
      const double v = y + 0.5;
      std::array<float, 3> value{from[0].at(u, v), from[1].at(u, v), from[2].at(u, v)};
      if (yuv) value = yuv_to_rgb(value[0], value[1], value[2]);
      for (int c = 0; c < 3; ++c) write(into, c, x, y, value[static_cast<std::size_t>(c)]);
    }
  }
}

bool same_grid(const PlaneGrid& a, const PlaneGrid& b) {
  return a.step_x == b.step_x && a.step_y == b.step_y && a.offset_x == b.offset_x && a.offset_y == b.offset_y;
}

void write_yuv(const std::array<Component, 3>& from, const MutableImageView& into) {
  for (int c = 0; c < component_count(into.format); ++c) {
    const PlaneGrid grid = component_grid(into.format, c);
    const Component& source = from[static_cast<std::size_t>(c)];
    // A sample of a coarser grid is the mean over half a pixel around its centre: of 2x2 pixels if it is between
    // pixels, weighted (1 2 1) / 4 if it is on one.
    const bool finer = !same_grid(grid, source.grid);
    const double dx = finer && grid.step_x > 1 ? 0.5 : 0;
    const double dy = finer && grid.step_y > 1 ? 0.5 : 0;
    const MutablePlaneView& plane = into.planes[static_cast<std::size_t>(c)];
    for (int y = 0; y < plane.height; ++y) {
      for (int x = 0; x < plane.width; ++x) {
        const double u = (x + 0.5 - grid.offset_x) * grid.step_x;
        const double v = (y + 0.5 - grid.offset_y) * grid.step_y;
        write(into, c, x, y,
              0.25F * (source.at(u - dx, v - dy) + source.at(u + dx, v - dy) + source.at(u - dx, v + dy) +
                       source.at(u + dx, v + dy)));
      }
    }
  }
}

}  // namespace

DecodedImage convert_image(const ImageView& image, PixelFormat to) {
  DecodedImage made{to, image.width, image.height, {}};
  made.bytes.resize(packed_size(to, image.width, image.height));
  const MutableImageView into = packed_image(to, image.width, image.height, made.bytes.data());
  if (to == PixelFormat::kGrey8 && is_yuv(image.format)) {  // luma as it is
    const PlaneView& luma = image.planes[0];
    for (int y = 0; y < image.height; ++y) {
      const std::uint8_t* from = luma.data + y * luma.row_stride;
      std::uint8_t* const row = made.bytes.data() + static_cast<std::ptrdiff_t>(y) * image.width;
      for (int x = 0; x < image.width; ++x, from += luma.pixel_stride) row[x] = *from;
    }
    return made;
  }
  std::array<Component, 3> from = components_of(image);
  if (to == PixelFormat::kRgb24) {
    write_rgb(from, is_yuv(image.format), into);
    return made;
  }
  if (!is_yuv(image.format)) rgb_to_yuv(from);
  write_yuv(from, into);
  return made;
}

}  // namespace nodal::media
