// Samples a raymap along rays.
#pragma once

#include <optional>
#include <vector>

#include "protocol/base/decoded_image.h"
#include "protocol/base/image.h"
#include "stitch/geometry/raymap/layout.h"
#include "stitch/parallel/workers.h"
#include "stitch/view/cell.h"
#include "stitch/view/filter.h"
#include "stitch/view/pieces.h"
#include "stitch/view/point_sampler.h"
#include "stitch/view/target.h"

namespace nodal::view {

/// A raymap's layout, prepared for sampling. Where the target's pixels are larger than the raymap's, each is the mean
/// of samples across it, up to Cell::kMaxSamples along each side: as many as it has pixels of the raymap below it.
/// Positions of pixels are exact to 1/64 px where the target is smooth, and those of samples within a pixel are linear
/// or closer; samples are exact to half a level.
///
/// Threading: immutable; any thread.
/// Ownership: keeps the layout by reference.
class Resampler {
 public:
  Resampler(const geometry::RaymapLayout& layout, Filter filter, const parallel::Workers& workers);
  Resampler(const Resampler&) = delete;
  Resampler& operator=(const Resampler&) = delete;

  /// Where the target's pixels are in the raymap: the same for every raymap of the layout.
  struct Plan {
    Target target;
    int columns = 0;                         ///< number of columns of cells
    std::vector<std::optional<Cell>> cells;  ///< row by row; without a value: sampled pixel by pixel
  };
  Plan plan(const Target& target, const parallel::Workers& workers) const;

  /// `raymap` has the layout's size; RGB24, GREY, RGB48 or GREY16, packed. The result has its format, and does not
  /// depend on the number of threads.
  DecodedImage resample(const ImageView& raymap, const Plan& plan, const parallel::Workers& workers) const;
  DecodedImage resample(const ImageView& raymap, const Target& target, const parallel::Workers& workers) const {
    return resample(raymap, plan(target, workers), workers);
  }

 private:
  template <class Sample>
  class Square;
  template <class Sample>
  DecodedImage resample_as(const ImageView& raymap, const Plan& plan, const parallel::Workers& workers) const;

  const geometry::RaymapLayout& layout_;
  const Taps& taps_;
  Filter filter_;
  Pieces pieces_;
  PointSampler sampler_;
};

}  // namespace nodal::view
