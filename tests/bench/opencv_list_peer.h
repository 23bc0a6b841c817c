// The best that a user of OpenCV gets of a list of rays in no order: for every head a list of where it sees those rays that
// it sees, cv::remap of that list, and a loop that adds what came of it to the rays.
#pragma once

#include <memory>

#include "protocol/base/image.h"
#include "stitch/table/ray_sampler.h"

namespace nodal::bench {

/// I420 heads into an I420 raymap, as the ray samples say; gains are left alone.
///
/// Threading: band() on any number of threads at once.
class OpenCvListPeer {
 public:
  explicit OpenCvListPeer(const table::RaySampler& sampler);
  ~OpenCvListPeer();
  static constexpr int kBandRows = 64;
  int bands() const;
  void band(std::span<const ImageView> heads, const MutableImageView& raymap, int band) const;
  /// What its maps, weights and lists take.
  double table_bytes() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace nodal::bench
