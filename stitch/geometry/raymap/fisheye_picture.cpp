#include "stitch/geometry/raymap/fisheye_picture.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <string>

#include "protocol/base/angles.h"

namespace nodal::geometry {
namespace {

constexpr double kMinFov = 10, kMaxFov = 360;  // degrees

/// The halves' size, and where the second one begins.
struct Halves {
  double width, height;
  Pixel second;
  bool stacked;
};

Halves halves_of(const FisheyePicture& lens, RaymapSize size) {
  const double width = size.width, height = size.height;
  if (!lens.dual) return {width, height, {width, 0}, false};
  if (width >= height) return {width / 2, height, {width / 2, 0}, false};
  return {width, height / 2, {0, height / 2}, true};
}

class FisheyeLayout final : public RaymapLayout {
 public:
  FisheyeLayout(const FisheyePicture& lens, RaymapSize size)
      : RaymapLayout(size.width, size.height),
        dual_(lens.dual),
        max_angle_(lens.fov_deg / 2 * kRadiansPerDegree),
        halves_(halves_of(lens, size)),
        density_(lens.pixels_per_radian(size)) {}

  std::string_view name() const override { return dual_ ? "dual_fisheye" : "fisheye"; }
  bool scattered() const override { return false; }

  std::optional<Ray> ray(double x, double y) const override {
    if (!(x >= 0 && x <= width() && y >= 0 && y <= height())) return std::nullopt;
    const bool back = second(x, y);
    const Pixel off = from_middle(x, y, back);
    const double r = std::hypot(off.x, off.y), angle = r / density_;
    if (angle > max_angle_) return std::nullopt;
    const double across = r > 0 ? std::sin(angle) / r : 0;
    const double sign = back ? -1 : 1;
    return Ray::towards(sign * off.x * across, off.y * across, sign * std::cos(angle));
  }

  double solid_angle(int i, int j) const override {
    const Pixel off = from_middle(i + 0.5, j + 0.5, second(i + 0.5, j + 0.5));
    const double angle = std::hypot(off.x, off.y) / density_;
    if (angle > max_angle_) return 0;
    const double stretched = angle > 1e-9 ? std::sin(angle) / angle : 1;
    return std::max(0.0, stretched) / (density_ * density_);
  }

  std::optional<Pixel> pixel(const Ray& ray) const override {
    const bool back = dual_ && ray.z() < 0;
    const double sign = back ? -1 : 1, side = std::hypot(ray.x(), ray.y());
    const double angle = std::atan2(side, sign * ray.z());
    if (angle > max_angle_) return std::nullopt;
    const Pixel middle = middle_of(back);
    // Straight behind a picture of 360 degrees is its whole rim.
    if (side == 0 && angle > 0) return Pixel{middle.x + angle * density_, middle.y};
    const double scale = side > 0 ? angle * density_ / side : 0;
    return Pixel{middle.x + sign * ray.x() * scale, middle.y + ray.y() * scale};
  }

 private:
  bool second(double x, double y) const {
    return dual_ && (halves_.stacked ? y >= halves_.second.y : x >= halves_.second.x);
  }
  Pixel middle_of(bool back) const {
    return {halves_.width / 2 + (back ? halves_.second.x : 0), halves_.height / 2 + (back ? halves_.second.y : 0)};
  }
  Pixel from_middle(double x, double y, bool back) const {
    const Pixel middle = middle_of(back);
    return {x - middle.x, y - middle.y};
  }

  bool dual_;
  double max_angle_;
  Halves halves_;
  double density_;  ///< pixels per radian along a radius
};

}  // namespace

std::optional<Result<FisheyePicture>> FisheyePicture::parse(std::string_view text) {
  constexpr std::string_view kOne = "fisheye:fov=", kTwo = "dual_fisheye:fov=";
  FisheyePicture lens;
  lens.dual = text.starts_with(kTwo);
  if (!lens.dual && !text.starts_with(kOne)) return std::nullopt;
  const std::string_view number = text.substr(lens.dual ? kTwo.size() : kOne.size());
  const auto [end, error] = std::from_chars(number.data(), number.data() + number.size(), lens.fov_deg);
  if (error != std::errc() || end != number.data() + number.size() || !(lens.fov_deg >= kMinFov) ||
      !(lens.fov_deg <= kMaxFov)) {
    return fail(Errc::kBadValue, "'" + std::string(text.substr(0, 64)) +
                                     "': the lens's field of view must be a number from 10 to 360, degrees");
  }
  return lens;
}

double FisheyePicture::pixels_per_radian(RaymapSize size) const {
  const Halves halves = halves_of(*this, size);
  return std::min(halves.width, halves.height) / (fov_deg * kRadiansPerDegree);
}

std::unique_ptr<RaymapLayout> FisheyePicture::layout(RaymapSize size) const {
  return std::make_unique<FisheyeLayout>(*this, size);
}

}  // namespace nodal::geometry
