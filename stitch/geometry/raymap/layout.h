// A raymap layout m(x, y) -> (theta, phi): which ray each pixel of a raymap holds (§3.2, §5).
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "protocol/base/result.h"
#include "stitch/geometry/ray.h"

namespace nodal::geometry {

/// The interface of all layouts. Width and height are those of the picture that holds the layout;
/// a picture may have pixels that hold no ray.
///
/// Threading: immutable; any thread.
class RaymapLayout {
 public:
  virtual ~RaymapLayout() = default;

  /// The name for make_layout().
  virtual std::string_view name() const = 0;
  int width() const { return width_; }
  int height() const { return height_; }

  /// True if neighbouring pixels do not hold neighbouring rays (random, Hammersley). Then never interpolate between
  /// pixels; ray(x, y) is the ray of the pixel that contains (x, y), and pixel() gives the centre of the pixel with the
  /// nearest ray.
  virtual bool scattered() const = 0;

  /// The ray at continuous coordinates, 0..width by 0..height; pixel (i, j)'s own ray is ray(i + .5, j + .5). Nothing
  /// where the layout holds no ray.
  virtual std::optional<Ray> ray(double x, double y) const = 0;

  /// The exact solid angle that pixel (i, j) represents, sr; 0 for a pixel that holds no ray. The sum over all pixels
  /// is the solid angle that the layout covers: 4 pi for a whole sphere.
  virtual double solid_angle(int i, int j) const = 0;

  /// The position of a ray in the raymap; nothing if the layout does not hold it.
  virtual std::optional<Pixel> pixel(const Ray& ray) const = 0;

 protected:
  RaymapLayout(int width, int height) : width_(width), height_(height) {}

 private:
  int width_;
  int height_;
};

inline constexpr int kMaxRaymapSide = 32768;

/// The width and height of a raymap in pixels.
struct RaymapSize {
  int width = 0;
  int height = 0;
};

/// The width, rarely a whole number, at which a whole-sphere raymap has `pixels_per_radian` where its pixels are
/// largest (equirectangular: at the equator; cube: in the centre of a face).
/// Errors: kUnsupported for an unknown name (the message lists the known ones).
Result<double> width_for_resolution(std::string_view name, double pixels_per_radian);

/// The smallest size of a whole-sphere raymap with at least this width, up to kMaxRaymapSide; valid for halved chroma.
/// Errors: as width_for_resolution().
Result<RaymapSize> size_for_width(std::string_view name, double width);

/// The names that make_layout() accepts.
std::vector<std::string_view> layout_names();

/// Errors: kUnsupported for an unknown name (the message lists the known ones), kBadValue for a size that the layout
/// cannot have (the message gives the nearest possible one).
Result<std::unique_ptr<RaymapLayout>> make_layout(std::string_view name, int width, int height);

}  // namespace nodal::geometry
