#include <fmt/format.h>

#include <cmath>
#include <numbers>

#include "hal/sim/scene/response.h"
#include "hal/sim/scene/scene.h"

namespace nodal::hal::sim {

namespace {

/// Catmull-Rom cubic: passes through the samples, with the slope given by their neighbours.
std::array<float, 4> cubic(float t) {
  return {((2 - t) * t - 1) * t / 2, ((3 * t - 5) * t * t + 2) / 2, ((4 - 3 * t) * t + 1) * t / 2, (t - 1) * t * t / 2};
}

/// The photograph in linear light, with downscaled levels for heads that see it smaller.
class PhotoScene final : public Scene {
 public:
  struct Level {
    int width = 0;
    int height = 0;
    std::vector<Light> pixels;
  };

  explicit PhotoScene(Level full) {
    levels_.push_back(std::move(full));
    while (levels_.back().width >= 64 && levels_.back().width % 2 == 0 && levels_.back().height % 2 == 0) {
      levels_.push_back(halved(levels_.back()));
    }
  }

  Light light(const Direction& d, double footprint) const override {
    const double longitude = std::atan2(d.x, d.z);
    const double latitude = std::atan2(d.y, std::sqrt(d.x * d.x + d.z * d.z));
    // The coarsest level whose pixels are not wider than a sample, or else the finest.
    std::size_t level = 0;
    while (level + 1 < levels_.size() && 2 * std::numbers::pi / levels_[level + 1].width <= footprint) ++level;
    const Level& from = levels_[level];
    const double x = (longitude / (2 * std::numbers::pi) + 0.5) * from.width - 0.5;
    const double y = (latitude / std::numbers::pi + 0.5) * from.height - 0.5;
    const double left = std::floor(x);
    const double top = std::floor(y);
    const auto across = cubic(static_cast<float>(x - left));
    const auto down = cubic(static_cast<float>(y - top));
    Light sum;
    for (int j = 0; j < 4; ++j) {
      for (int i = 0; i < 4; ++i) {
        const float w = across[static_cast<std::size_t>(i)] * down[static_cast<std::size_t>(j)];
        const Light& p = pixel(from, static_cast<int>(left) - 1 + i, static_cast<int>(top) - 1 + j);
        sum = {sum.r + w * p.r, sum.g + w * p.g, sum.b + w * p.b};
      }
    }
    return {std::max(sum.r, 0.0F), std::max(sum.g, 0.0F), std::max(sum.b, 0.0F)};
  }

 private:
  /// Columns wrap around; beyond a pole the picture continues on the opposite meridian.
  static const Light& pixel(const Level& level, int x, int y) {
    if (y < 0 || y >= level.height) {
      y = y < 0 ? -1 - y : 2 * level.height - 1 - y;
      x += level.width / 2;
    }
    x %= level.width;
    if (x < 0) x += level.width;
    return level
        .pixels[static_cast<std::size_t>(y) * static_cast<std::size_t>(level.width) + static_cast<std::size_t>(x)];
  }

  static Level halved(const Level& full) {
    Level half{full.width / 2, full.height / 2, {}};
    half.pixels.reserve(full.pixels.size() / 4);
    for (int y = 0; y < half.height; ++y) {
      for (int x = 0; x < half.width; ++x) {
        const Light& a = pixel(full, 2 * x, 2 * y);
        const Light& b = pixel(full, 2 * x + 1, 2 * y);
        const Light& c = pixel(full, 2 * x, 2 * y + 1);
        const Light& d = pixel(full, 2 * x + 1, 2 * y + 1);
        half.pixels.push_back({(a.r + b.r + c.r + d.r) / 4, (a.g + b.g + c.g + d.g) / 4, (a.b + b.b + c.b + d.b) / 4});
      }
    }
    return half;
  }

  std::vector<Level> levels_;
};

}  // namespace

Result<ScenePtr> photo_scene(const ImageView& image, const Response& encoding) {
  if (image.format != PixelFormat::kRgb24 && image.format != PixelFormat::kGrey8) {
    return fail(Errc::kUnsupported, "scene photograph: pixels are " + std::string(pixel_format_name(image.format)) +
                                        "; give RGB24 or GREY");
  }
  if (image.width < 8 || image.width != 2 * image.height) {
    return fail(Errc::kBadValue,
                fmt::format("scene photograph: it is {}x{}; an equirectangular picture is twice as wide as it is high",
                            image.width, image.height));
  }
  std::array<float, 256> linear{};
  for (std::size_t i = 0; i < linear.size(); ++i) {
    linear[i] = static_cast<float>(decode(encoding, static_cast<double>(i) / 255));
  }
  PhotoScene::Level full{image.width, image.height, {}};
  full.pixels.reserve(static_cast<std::size_t>(image.width) * static_cast<std::size_t>(image.height));
  const bool grey = image.format == PixelFormat::kGrey8;
  const auto sample = [&](std::size_t c, int x, int y) {
    const PlaneView& plane = image.planes[grey ? 0 : c];
    return linear[plane.data[y * plane.row_stride + static_cast<std::ptrdiff_t>(x) * plane.pixel_stride]];
  };
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < image.width; ++x) full.pixels.push_back({sample(0, x, y), sample(1, x, y), sample(2, x, y)});
  }
  return std::make_shared<PhotoScene>(std::move(full));
}

}  // namespace nodal::hal::sim
