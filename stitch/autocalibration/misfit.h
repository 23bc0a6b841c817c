// Why a picture does not fit the others: it is mirrored, or its lens has another focal length.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "protocol/base/decoded_image.h"
#include "stitch/autocalibration/arrangement.h"
#include "stitch/autocalibration/picture.h"
#include "stitch/autocalibration/sight.h"
#include "stitch/parallel/workers.h"

namespace nodal::autocalibration {

/// Two pictures that show the same things, but not as two pictures of one lens from one place do.
struct Misfit {
  enum class Cause : std::uint8_t { kMirrored, kFocal } cause = Cause::kMirrored;
  std::size_t picture = 0, other = 0;
  double focal_ratio = 1;  ///< kFocal: focal length of `picture`, units of its radius, divided by that of `other`
};

/// Everything that the search reads; all must outlive it.
struct MisfitSearch {
  const std::vector<DecodedImage>& pictures;  ///< kGrey8
  const std::vector<Shape>& shapes;
  const std::vector<Picture>& small;
  const Sight& sight;
  const parallel::Workers& workers;
};

/// Compares pictures that could not be placed with those that could, by the lens of the latter. At most one misfit for
/// a picture.
std::vector<Misfit> misfits_of(const MisfitSearch& search, const Arrangement& arrangement);

/// The first pair of pictures that would fit if one of them were mirrored or had another focal length, if no picture
/// could be placed. At most kMaxCompared pictures are compared.
std::optional<Misfit> first_misfit(const MisfitSearch& search);

inline constexpr std::size_t kMaxCompared = 20;

}  // namespace nodal::autocalibration
