// The features of pictures of one scene, their matches, and how many features look alike.
#pragma once

#include <cstddef>
#include <functional>
#include <vector>

#include "protocol/base/decoded_image.h"
#include "stitch/autocalibration/arrangement.h"
#include "stitch/autocalibration/features.h"
#include "stitch/autocalibration/matches.h"
#include "stitch/parallel/workers.h"

namespace nodal::autocalibration {

struct Sight {
  std::vector<std::vector<Feature>> features;  ///< by picture, in its pixels
  std::vector<Match> matches;                  ///< matches of all pairs of pictures
  Repetition repetition;                       ///< repetition in all pairs of pictures
};

/// Features of one picture, in its pixels.
std::vector<Feature> features_of(const DecodedImage& picture, const Shape& shape);

/// Features and matches of whole pictures, which are reduced to a size that suits the work. `progress`: 0..1, on the
/// caller's thread.
Sight see(const std::vector<DecodedImage>& pictures, const std::vector<Shape>& shapes, const parallel::Workers& workers,
          const std::function<void(double)>& progress = {});

/// The same of the rims of fisheyes, in more detail: used if their overlaps are so thin that few of the features of
/// whole pictures are in them. All shapes must have a circle.
Sight see_rims(const std::vector<DecodedImage>& pictures, const std::vector<Shape>& shapes,
               const parallel::Workers& workers, const std::function<void(double)>& progress = {});

}  // namespace nodal::autocalibration
