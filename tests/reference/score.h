// The distance of a raymap from the truth, the measure of all of Nodal's figures (the reference data's score.py
// computes the same in Python).
#pragma once

#include <cstdint>
#include <span>

#include "protocol/base/image.h"
#include "stitch/geometry/raymap/layout.h"

namespace nodal::test {

struct Score {
  double psnr_db = 0;
  double covered = 0;  ///< share of the sphere whose pixels are not black
};

/// PSNR over all components, each pixel weighted by its solid angle, after one least-squares gain per component.
/// Completely black pixels count as not covered and are left out. RGB24 or GREY, both of the layout's size.
Score score(const ImageView& raymap, const ImageView& truth, const geometry::RaymapLayout& layout);

/// Structural similarity (Wang et al. 2004) of two RGB24 pictures' luma over 8x8 blocks, each weighted by the solid
/// angle at its centre; 1 for equal pictures.
double ssim(const ImageView& a, const ImageView& b, const geometry::RaymapLayout& layout);

/// PSNR of two pictures with all bytes weighted equally, and the largest difference.
struct Difference {
  double psnr_db = 0;
  int largest = 0;
  std::size_t differing = 0;
};
Difference difference(std::span<const std::uint8_t> a, std::span<const std::uint8_t> b);

}  // namespace nodal::test
