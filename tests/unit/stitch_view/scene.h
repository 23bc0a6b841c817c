// A smooth scene as a function of the ray: what every raymap of it must show, and every view into one.
#pragma once

#include <cmath>
#include <cstdint>

#include "protocol/base/decoded_image.h"
#include "stitch/view/resampler.h"

namespace nodal::view {

/// 30 to 226, up to about 800 levels per radian.
inline double level(const geometry::Ray& ray) {
  return 128 + 40 * std::sin(9 * ray.x() + 1) + 30 * std::sin(8 * ray.y() + 2 * ray.x()) +
         28 * std::cos(7 * ray.z() - 3 * ray.y());
}

/// What a picture with these rays shows, at the middle of its pixels; 0 where there is none.
inline DecodedImage picture_of(const Target& target) {
  DecodedImage image{PixelFormat::kGrey8, target.width, target.height, {}};
  for (int j = 0; j < target.height; ++j) {
    for (int i = 0; i < target.width; ++i) {
      const auto ray = target.ray(i + 0.5, j + 0.5);
      image.bytes.push_back(ray ? static_cast<std::uint8_t>(std::lround(level(*ray))) : std::uint8_t{0});
    }
  }
  return image;
}

/// How far a picture is from the scene, levels.
struct Off {
  double rms = 0;
  double worst = 0;
};

inline Off off_scene(const DecodedImage& image, const Target& target) {
  Off off;
  double sum = 0, count = 0;
  for (int j = 0; j < target.height; ++j) {
    for (int i = 0; i < target.width; ++i) {
      const auto ray = target.ray(i + 0.5, j + 0.5);
      const double shown = image.bytes[static_cast<std::size_t>(j * target.width + i)];
      const double difference = std::abs(shown - (ray ? level(*ray) : 0));
      sum += difference * difference, count += 1;
      off.worst = std::max(off.worst, difference);
    }
  }
  off.rms = std::sqrt(sum / count);
  return off;
}

}  // namespace nodal::view
