// The best that a user of OpenCV gets: cv::remap by fixed-point maps, plane by plane, in bands, only where a head looks;
// straight into the raymap where it looks alone, and mixed by a loop of its own elsewhere.
#pragma once

#include <memory>

#include "protocol/base/image.h"
#include "stitch/table/ray_sampler.h"

namespace nodal::bench {

/// I420 heads into an I420 raymap, as the ray samples say; gains are left alone.
///
/// Threading: band() on any number of threads at once.
class OpenCvPeer {
 public:
  explicit OpenCvPeer(const table::RaySampler& sampler);
  ~OpenCvPeer();
  static constexpr int kBandRows = 64;
  int bands() const;
  void band(std::span<const ImageView> heads, const MutableImageView& raymap, int band) const;
  /// What its maps and weights take.
  double table_bytes() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace nodal::bench
