// Samples a raymap along rays.
#pragma once

#include <cstdint>
#include <functional>
#include <limits>
#include <optional>
#include <string_view>
#include <vector>

#include "protocol/base/decoded_image.h"
#include "protocol/base/image.h"
#include "protocol/base/result.h"
#include "stitch/geometry/ray.h"
#include "stitch/geometry/raymap/layout.h"
#include "stitch/parallel/workers.h"

namespace nodal::view {

enum class Filter : std::uint8_t { kNearest, kBilinear, kBicubic };

/// "nearest", "bilinear", "bicubic". Errors: kBadValue, with the names.
Result<Filter> parse_filter(std::string_view text);

/// The rays of the picture that is made.
struct Target {
  int width = 0;
  int height = 0;
  /// The ray at continuous coordinates; nothing where the picture is black.
  std::function<std::optional<geometry::Ray>(double x, double y)> ray;
  /// Of a scattered layout: the solid angle of every pixel, sr. Else 0: the pixel's own outline is its footprint.
  double pixel_sr = 0;
  /// Neighbouring points have neighbouring rays everywhere, as in a camera.
  bool smooth = false;

  static Target of(const geometry::RaymapLayout& layout);
};

/// A raymap's layout, prepared for sampling. Bicubic is Catmull and Rom's (-1/2). Where the target's pixels are larger
/// than the raymap's, each is the mean of n x n samples across it, n up to kMostSamples: as many as it has pixels of the
/// raymap below it. Where the pixels around a position are not neighbours on the sphere (edges of faces, of discs, of
/// rows; scattered raymaps), the sample is the mean of the nearest pixels of nine rays about it, weighted by
/// their distance. Into smooth targets, positions in raymaps whose rows are circles are exact to 1/64 px only.
///
/// Threading: immutable; any thread.
/// Ownership: keeps the layout by reference.
class Resampler {
 public:
  static constexpr int kMostSamples = 8;

  Resampler(const geometry::RaymapLayout& layout, Filter filter, const parallel::Workers& workers);

  /// `raymap` has the layout's size; RGB24 or GREY. The result does not depend on the number of threads.
  DecodedImage resample(const ImageView& raymap, const Target& target, const parallel::Workers& workers) const;

 private:
  struct Sum {
    float value[3] = {0, 0, 0};
  };
  /// Where a ray is in the raymap, px; NaN if it is not there.
  struct Position {
    double x, y;
  };
  static constexpr Position kNowhere{std::numeric_limits<double>::quiet_NaN(),
                                     std::numeric_limits<double>::quiet_NaN()};
  class Band;
  bool smooth(int i, int j, int reach) const;
  double pitch_at(const Position& at) const;
  static void add_sample(const std::uint8_t* at, int channels, float weight, Sum& sum);
  /// Adds the raymap at a position; `ray` is asked for only where the position is not enough.
  void add(const PlaneView& plane, int channels, const Position& at, const std::function<geometry::Ray()>& ray,
           Sum& sum) const;
  void add_pixel(const PlaneView& plane, int channels, int i, int j, float weight, Sum& sum) const;
  void add_across_edge(const PlaneView& plane, int channels, const geometry::Ray& ray, Sum& sum) const;

  const geometry::RaymapLayout& layout_;
  Filter filter_;
  bool wraps_;  ///< rows are whole circles of latitude: the first pixel follows the last
  double mean_sr_;
  /// By pixel (i, j): whether the square of pixels (i, j) .. (i + 1, j + 1) is one piece of the sphere. Empty if all are.
  std::vector<std::uint8_t> joined_;
};

}  // namespace nodal::view
