// A raymap layout m(x, y) -> (theta, phi): which ray each pixel of a raymap holds (§3.2, §5).
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "protocol/base/result.h"
#include "stitch/geometry/ray.h"
#include "stitch/geometry/raymap/patch.h"
#include "stitch/geometry/raymap/registry.h"

namespace nodal::geometry {

/// The interface of all layouts. Width and height are those of the picture that holds the layout;
/// a picture may have pixels that hold no ray.
///
/// Threading: immutable; any thread.
class RaymapLayout {
 public:
  virtual ~RaymapLayout() = default;

  /// The name for make_layout(), without parameters.
  virtual std::string_view name() const = 0;
  int width() const { return width_; }
  int height() const { return height_; }

  /// True if neighbouring pixels do not hold neighbouring rays (random, Hammersley). Then never interpolate between
  /// pixels; ray(x, y) is the ray of the pixel that contains (x, y), and pixel() gives the centre of the pixel with the
  /// nearest ray.
  virtual bool scattered() const = 0;

  /// Whether the layout consists of faces that are convex in the picture, and the ray is a smooth function of the place
  /// within each: then rays can be interpolated. Not if every row has a scale of its own.
  virtual bool smooth() const { return !scattered(); }

  /// Parts of the sphere whose pixels have a regular order in the raymap: `run` consecutive pixels (row * width +
  /// column) hold rays of one cell, the next `run` pixels of the next cell, and after the last cell the first one
  /// follows again.
  struct Cells {
    std::uint64_t count = 0;  ///< 0: there are none
    std::uint64_t run = 1;
    std::uint64_t of(std::uint64_t pixel) const { return pixel / run % count; }
  };
  /// For scattered layouts with a regular order: cells of about `rays` rays or more. Each is compact, or goes around
  /// the sphere and is at least as high as `side` rays would be apart if all rays were spread evenly.
  virtual Cells cells([[maybe_unused]] std::int64_t rays, [[maybe_unused]] double side) const { return {}; }

  /// The ray at continuous coordinates, 0..width by 0..height; pixel (i, j)'s own ray is ray(i + .5, j + .5). Nothing
  /// where the layout holds no ray.
  virtual std::optional<Ray> ray(double x, double y) const = 0;

  /// The exact solid angle that pixel (i, j) represents, sr; 0 for a pixel that holds no ray or, as padding does, the
  /// ray of another. The sum over all pixels is the solid angle that the layout covers: 4 pi for a whole sphere. For
  /// point sequences it is the mean over all points.
  virtual double solid_angle(int i, int j) const = 0;

  /// The position of a ray in the raymap; nothing if the layout does not hold it.
  virtual std::optional<Pixel> pixel(const Ray& ray) const = 0;

  /// The patches that together are the layout, without overlap. None if it has none, as scattered layouts.
  virtual std::vector<LayoutPatch> patches() const { return {}; }

 protected:
  RaymapLayout(int width, int height) : width_(width), height_(height) {}

 private:
  int width_;
  int height_;
};

/// `text` as LayoutName::parse() takes it.
/// Errors: those of LayoutName::parse(), kBadValue for a size that the layout cannot have (the message gives the
/// nearest possible one).
Result<std::unique_ptr<RaymapLayout>> make_layout(std::string_view text, int width, int height);
Result<std::unique_ptr<RaymapLayout>> make_layout(const LayoutName& name, int width, int height);

}  // namespace nodal::geometry
