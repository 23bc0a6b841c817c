// The best that a user of OpenCV can achieve: cv::remap with fixed-point maps, plane by plane, in bands. For raymaps
// with ordered rays, only where a head looks: directly into the raymap where it looks alone, and blended by a
// hand-written loop elsewhere. For an unordered list of rays, a list per head of the rays that it sees, and a loop that
// adds the remapped samples to the rays.
#pragma once

#include <memory>

#include "protocol/base/image.h"
#include "stitch/table/ray_sampler.h"

namespace nodal::bench {

enum class RaysAre : std::uint8_t { kInOrder, kInNoOrder };

/// Blends I420 heads into an I420 raymap by the given ray samples; without gains.
///
/// Threading: band() may run on any number of threads at once.
class OpenCvPeer {
 public:
  OpenCvPeer(const table::RaySampler& sampler, RaysAre rays);
  ~OpenCvPeer();
  static constexpr int kBandRows = 64;
  int bands() const;
  void band(std::span<const ImageView> heads, const MutableImageView& raymap, int band) const;
  /// The memory of its maps and weights.
  double table_bytes() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace nodal::bench
