#include "stitch/autocalibration/overlap.h"

#include <algorithm>
#include <cmath>

#include "stitch/autocalibration/bundle.h"
#include "stitch/geometry/masks.h"

namespace nodal::autocalibration {
namespace {

constexpr int kSide = 128;        // px
constexpr int kWide = 6;          // px; half width of the blur that removes detail
constexpr double kMinDetail = 3;  // levels rms: sky and noise have less
constexpr int kFewest = 150;      // rays
constexpr double kInside = 0.95;  // share of the image circle's radius that is compared

Picture smaller(const Picture& picture) {
  const int by = std::max(1, std::max(picture.width, picture.height) / kSide);
  Picture small{picture.width / by, picture.height / by, {}};
  for (int y = 0; y < small.height; ++y) {
    for (int x = 0; x < small.width; ++x) {
      float sum = 0;
      for (int j = 0; j < by; ++j) {
        for (int i = 0; i < by; ++i) sum += picture.at(x * by + i, y * by + j);
      }
      small.values.push_back(sum / static_cast<float>(by * by));
    }
  }
  return small;
}

Picture detail_of(const Picture& picture) {
  Picture detail = picture;
  for (int y = 0; y < picture.height; ++y) {
    for (int x = 0; x < picture.width; ++x) {
      float sum = 0, count = 0;
      for (int j = std::max(0, y - kWide); j <= std::min(picture.height - 1, y + kWide); ++j) {
        for (int i = std::max(0, x - kWide); i <= std::min(picture.width - 1, x + kWide); ++i) {
          sum += picture.at(i, j);
          ++count;
        }
      }
      detail.values[static_cast<std::size_t>(y) * static_cast<std::size_t>(picture.width) +
                    static_cast<std::size_t>(x)] -= sum / count;
    }
  }
  return detail;
}

/// `px`: pixels of the whole picture in one of `small`.
std::vector<std::uint8_t> masked_pixels(const Shape& shape, double px, const Picture& small) {
  const geometry::Masks masks(
      Region{0, 0, static_cast<double>(shape.width), static_cast<double>(shape.height), {}, shape.masks});
  std::vector<std::uint8_t> masked;
  for (int y = 0; y < small.height; ++y) {
    for (int x = 0; x < small.width; ++x)
      masked.push_back(masks.distance({(x + 0.5) * px, (y + 0.5) * px}, px) < px ? 1 : 0);
  }
  return masked;
}

bool is_masked(const std::vector<std::uint8_t>& masked, const Picture& picture, int x, int y) {
  return !masked.empty() &&
         masked[static_cast<std::size_t>(y) * static_cast<std::size_t>(picture.width) + static_cast<std::size_t>(x)] !=
             0;
}

}  // namespace

Overlaps::Overlaps(const std::vector<Shape>& shapes, const std::vector<Picture>& small) {
  for (std::size_t h = 0; h < shapes.size(); ++h) {
    Detail detail;
    detail.picture = detail_of(smaller(small[h]));
    const double px = static_cast<double>(shapes[h].width) / std::max(1, detail.picture.width);
    detail.scale = px / shapes[h].unit();
    detail.center = Eigen::Vector2d(shapes[h].center().x, shapes[h].center().y) / px;
    detail.radius = shapes[h].circle ? kInside * shapes[h].circle->radius / px : 0;
    if (!shapes[h].masks.empty()) detail.masked = masked_pixels(shapes[h], px, detail.picture);
    details_.push_back(std::move(detail));
  }
}

double Overlaps::correlation(std::size_t a, std::size_t b, const Eigen::Matrix3d& R_b_a, const SharedLens& lens_a,
                             const SharedLens& lens_b) const {
  const Result<LensRays> rays = LensRays::make(lens_a), rays_b = LensRays::make(lens_b);
  if (!rays || !rays_b) return 0;
  const Detail& in_a = details_[a];
  const Detail& in_b = details_[b];
  double n = 0, sa = 0, sb = 0, saa = 0, sbb = 0, sab = 0;
  for (int y = 0; y < in_a.picture.height; ++y) {
    for (int x = 0; x < in_a.picture.width; ++x) {
      const Eigen::Vector2d from = Eigen::Vector2d(x + 0.5, y + 0.5) - in_a.center;
      if (in_a.radius > 0 && from.norm() > in_a.radius) continue;
      if (is_masked(in_a.masked, in_a.picture, x, y)) continue;
      const auto ray = rays->ray(from * in_a.scale);
      const auto at = ray ? rays_b->at(R_b_a * *ray) : std::nullopt;
      if (!at) continue;
      const Eigen::Vector2d to = *at / in_b.scale;
      if (in_b.radius > 0 && to.norm() > in_b.radius) continue;
      const double u = to.x() + in_b.center.x() - 0.5, v = to.y() + in_b.center.y() - 0.5;
      if (u < 0 || v < 0 || u >= in_b.picture.width - 1 || v >= in_b.picture.height - 1) continue;
      const int i = static_cast<int>(u), j = static_cast<int>(v);
      if (is_masked(in_b.masked, in_b.picture, i, j)) continue;
      const double fx = u - i, fy = v - j;
      const double light_b =
          (1 - fy) * ((1 - fx) * double{in_b.picture.at(i, j)} + fx * double{in_b.picture.at(i + 1, j)}) +
          fy * ((1 - fx) * double{in_b.picture.at(i, j + 1)} + fx * double{in_b.picture.at(i + 1, j + 1)});
      const double light_a = double{in_a.picture.at(x, y)};
      ++n, sa += light_a, sb += light_b, saa += light_a * light_a, sbb += light_b * light_b, sab += light_a * light_b;
    }
  }
  if (n < kFewest) return kCannotTell;
  const double va = saa - sa * sa / n, vb = sbb - sb * sb / n;
  if (std::min(va, vb) < n * kMinDetail * kMinDetail) return kCannotTell;
  return (sab - sa * sb / n) / std::sqrt(va * vb);
}

}  // namespace nodal::autocalibration
