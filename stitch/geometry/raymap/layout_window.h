// A rectangle of a raymap, as a picture of its own.
#pragma once

#include "stitch/geometry/raymap/layout.h"

namespace nodal::geometry {

/// The columns from `left` and the rows from `top` of another layout, whose columns continue at 0 after the last one.
///
/// Ownership: refers to the whole layout.
class LayoutWindow final : public RaymapLayout {
 public:
  LayoutWindow(const RaymapLayout& whole, int left, int top, int width, int height)
      : RaymapLayout(width, height), whole_(whole), left_(left), top_(top) {}

  std::string_view name() const override { return whole_.name(); }
  bool scattered() const override { return whole_.scattered(); }
  bool smooth() const override { return whole_.smooth(); }
  std::optional<Ray> ray(double x, double y) const override { return whole_.ray(column(x), top_ + y); }
  double solid_angle(int i, int j) const override { return whole_.solid_angle((left_ + i) % whole_.width(), top_ + j); }
  std::optional<Pixel> pixel(const Ray& ray) const override {
    std::optional<Pixel> at = whole_.pixel(ray);
    if (!at) return std::nullopt;
    at->x -= left_;
    at->y -= top_;
    if (at->x < 0) at->x += whole_.width();
    if (at->x > width() || at->y < 0 || at->y > height()) return std::nullopt;
    return at;
  }

 private:
  double column(double x) const {
    const double sum = left_ + x;
    return sum <= whole_.width() ? sum : sum - whole_.width();
  }

  const RaymapLayout& whole_;
  int left_;
  int top_;
};

}  // namespace nodal::geometry
