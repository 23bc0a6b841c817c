// One head's picture, sampled along rays in floating point.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <optional>
#include <vector>

#include "protocol/base/image.h"
#include "stitch/bands/layer.h"
#include "stitch/geometry/head.h"
#include "stitch/parallel/workers.h"
#include "stitch/table/head_optics.h"

namespace nodal::offline {

/// What one head sees of a ray.
struct Sighting {
  geometry::Pixel pixel;
  double density = 0;  ///< original pixels per steradian
  double score = 0;    ///< > 0; how well the head shows the ray: density times the distance from the region's edges
  double inside = 0;   ///< px of the picture to the nearest edge of the region or of a mask
};

/// A head, prepared for many pictures.
///
/// Threading: immutable; any thread.
class HeadView {
 public:
  /// `power`: for raymaps of linear light (`format`), table::linear_power() of the rig.
  HeadView(const geometry::Head& head, PixelFormat format, double power);

  const geometry::Head& head() const { return head_; }
  /// Nothing outside the region.
  std::optional<Sighting> see(const Eigen::Vector3d& rig_ray) const;
  /// The smallest window that is sure to hold all that the head sees.
  bands::Window window(bands::Grid grid) const;
  /// Undoes the head's gain and vignetting: factors of what value() gives, for R G B.
  std::array<float, 3> factors(geometry::Pixel pixel) const;
  /// The largest of them: a full sample where the lens is darkest.
  double largest_factor() const;
  /// A sample of the picture as the number that is blended, 0 .. 255: the sample itself, or light^(1 / power).
  float value(std::uint8_t sample) const { return values_[sample]; }

 private:
  geometry::Head head_;
  table::HeadOptics optics_;
  std::array<float, 256> values_{};
};

/// A head's picture with a pyramid of halves.
///
/// Threading: immutable; any thread.
/// Ownership: keeps the view by reference; the finest level is the caller's picture.
class HeadPicture {
 public:
  /// RGB24 or GREY.
  HeadPicture(const HeadView& view, const ImageView& picture);

  int colours() const { return colours_; }
  /// The colours at a point, by cubic interpolation in the coarsest level whose pixels are not larger than the given
  /// size.
  void sample(const Sighting& at, double radians_per_pixel, float* into) const;
  /// The picture on a window of a grid: the colours, then the score; all 0 where the head does not see.
  bands::Layer on(bands::Grid grid, const bands::Window& window, const parallel::Workers& workers) const;
  /// The same where `see` says: what the head sees at a position in the grid, in pixels from its upper left corner.
  using See = std::function<std::optional<Sighting>(double u, double v)>;
  bands::Layer on(bands::Grid grid, const bands::Window& window, const parallel::Workers& workers,
                  const See& see) const;
  /// The head's ray for a ray of a grid.
  using Moved = std::function<Eigen::Vector3d(const Eigen::Vector3d&)>;

 private:
  struct Level {
    const std::uint8_t* data = nullptr;
    std::ptrdiff_t stride = 0;
    int width = 0;
    int height = 0;
  };
  void add_half();

  const HeadView& view_;
  int colours_;
  std::vector<Level> levels_;
  std::vector<std::vector<std::uint8_t>> memory_;
};

/// The ray of a position in a grid, in its pixels.
Eigen::Vector3d ray_of(bands::Grid grid, double u, double v);

}  // namespace nodal::offline
