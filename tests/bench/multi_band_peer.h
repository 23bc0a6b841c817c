// OpenCV's MultiBandBlender, as a user would call it with everything precomputed that does not change from set to set.
#pragma once

#include <memory>
#include <span>

#include "protocol/base/image.h"
#include "stitch/table/ray_sampler.h"

namespace nodal::bench {

/// Blends I420 heads into an I420 raymap. Every head is remapped with fixed-point maps into the smallest rectangle of
/// the raymap that holds what it sees. The masks are those of the seams of `sampler`: each pixel is the best head's, so
/// that no time goes into finding seams.
///
/// Threading: thread-bound; one thread (OpenCvPeer turns off OpenCV's own).
class MultiBandPeer {
 public:
  explicit MultiBandPeer(const table::RaySampler& sampler);
  ~MultiBandPeer();
  void blend(std::span<const ImageView> heads, const MutableImageView& raymap);
  /// The memory of its maps and masks.
  double table_bytes() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace nodal::bench
