#include "host_tool/report/pictured_heads.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "protocol/base/image.h"
#include "protocol/base/try.h"
#include "stitch/geometry/response.h"

namespace nodal::host {
namespace {

using geometry::Head;
using geometry::Pixel;
using geometry::Ray;

double value(const ImageView& image, int x, int y) {
  const auto component = [&](std::size_t c) {
    const PlaneView& plane = image.planes[c];
    return static_cast<double>(plane.data[y * plane.row_stride + x * plane.pixel_stride]);
  };
  if (image.format != PixelFormat::kRgb24) return component(0);
  return 0.299 * component(0) + 0.587 * component(1) + 0.114 * component(2);
}

/// Colour of the sample that covers the point; YUV by full-range BT.601.
std::array<double, 3> colour(const ImageView& image, double x, double y) {
  const auto component = [&](std::size_t c) {
    const PlaneView& plane = image.planes[c];
    const int i = std::clamp(static_cast<int>(x * plane.width / image.width), 0, plane.width - 1);
    const int j = std::clamp(static_cast<int>(y * plane.height / image.height), 0, plane.height - 1);
    return static_cast<double>(plane.data[j * plane.row_stride + i * plane.pixel_stride]);
  };
  if (component_count(image.format) == 1) return {component(0), component(0), component(0)};
  if (!has_chroma(image.format)) return {component(0), component(1), component(2)};
  const double luma = component(0), u = component(1) - 128, v = component(2) - 128;
  return {luma + 1.402 * v, luma - 0.344136 * u - 0.714136 * v, luma + 1.772 * u};
}

double sample(const ImageView& image, double x, double y) {
  const int i = std::clamp(static_cast<int>(std::floor(x)), 0, image.width - 2);
  const int j = std::clamp(static_cast<int>(std::floor(y)), 0, image.height - 2);
  const double fx = std::clamp(x - i, 0.0, 1.0), fy = std::clamp(y - j, 0.0, 1.0);
  return (1 - fy) * ((1 - fx) * value(image, i, j) + fx * value(image, i + 1, j)) +
         fy * ((1 - fx) * value(image, i, j + 1) + fx * value(image, i + 1, j + 1));
}

}  // namespace

double PicturedHeads::Curve::operator()(double level) const {
  return values_[static_cast<std::size_t>(std::clamp(level, 0.0, 255.0) * 4 + 0.5)];
}

PicturedHeads::PicturedHeads(std::vector<Head> heads, const registration::FrameSet& frames)
    : heads_(std::move(heads)), frames_(frames), encode_([&](double root) {
        return 255 * std::clamp(geometry::encode(heads_.front().calibration().response, root * root), 0.0, 1.0);
      }) {
  for (const Head& head : heads_) {
    decode_.emplace_back([&](double level) { return 255 * geometry::decode(head.calibration().response, level); });
  }
}

Result<PicturedHeads> PicturedHeads::make(const Calibration& calibration, const registration::FrameSet& frames) {
  NODAL_TRY_ASSIGN(std::vector<Head> heads, geometry::make_heads(calibration));
  return PicturedHeads(std::move(heads), frames);
}

std::optional<Pixel> PicturedHeads::pixel(std::size_t head, const Ray& ray) const { return heads_[head].pixel_of(ray); }

std::optional<double> PicturedHeads::light(std::size_t head, const Ray& ray) const {
  const auto at = pixel(head, ray);
  if (!at) return std::nullopt;
  const HeadCalibration& own = heads_[head].calibration();
  const double encoded = sample(frames_[head], at->x - 0.5, at->y - 0.5);
  const double gain = (own.gain[0] + own.gain[1] + own.gain[2]) / 3;
  return decode_[head](encoded) / (gain * std::max(heads_[head].vignetting(*at), 0.05));
}

std::optional<std::array<double, 3>> PicturedHeads::colours(std::size_t head, const Ray& ray) const {
  const auto at = pixel(head, ray);
  if (!at) return std::nullopt;
  const HeadCalibration& own = heads_[head].calibration();
  const std::array<double, 3> encoded = colour(frames_[head], at->x, at->y);
  std::array<double, 3> light{};
  const double fall_off = std::max(heads_[head].vignetting(*at), 0.05);
  for (std::size_t c = 0; c < 3; ++c) light[c] = decode_[head](encoded[c]) / (own.gain[c] * fall_off);
  return light;
}

std::uint8_t PicturedHeads::shown(double light) const {
  return static_cast<std::uint8_t>(encode_(255 * std::sqrt(std::clamp(light / 255, 0.0, 1.0))) + 0.5);
}

}  // namespace nodal::host
