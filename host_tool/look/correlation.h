// Where another head's picture shows what is at a pixel of one, by normalized correlation.
#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include "protocol/base/image.h"
#include "stitch/geometry/head.h"

namespace nodal::host::look {

/// The brightness of a picture in its full size, half of it, a quarter, and so on.
///
/// Threading: immutable.
class GreyPyramid {
 public:
  explicit GreyPyramid(const ImageView& picture);
  /// Between pixels, at a point of the full picture; nothing where the level's picture has no four pixels around it.
  std::optional<float> at(const geometry::Pixel& pixel, std::size_t level) const;
  std::size_t levels() const { return levels_.size(); }

 private:
  struct Level {
    int width = 0, height = 0;
    std::vector<float> values;
  };
  std::vector<Level> levels_;
};

/// A head with its picture.
struct SeenBy {
  const geometry::Head& head;
  const GreyPyramid& picture;
};

struct Found {
  geometry::Pixel pixel;
  double correlation = 0;  ///< 1: the same but for brightness and contrast
};

/// The place in `to` that looks as the surroundings of `pixel` in `from` do. Both are sampled in the same directions of
/// the rig, so lenses and turned heads make no difference. `near`: where to begin; nothing: where the calibration says.
/// `within_px`: how far from there it may be, in pixels of `from`.
/// No result if a head does not see the place, or if it shows no detail or only a straight edge.
std::optional<Found> find_again(const SeenBy& from, const geometry::Pixel& pixel, const SeenBy& to,
                                const std::optional<geometry::Pixel>& near, double within_px);

}  // namespace nodal::host::look
