// The best that a user of OpenCV gets: cv::remap by fixed-point maps, plane by plane, in bands. Of raymaps whose rays are in
// order, only where a head looks: straight into the raymap where it looks alone, and mixed by a loop of its own elsewhere.
// Of a list of rays in no order, for every head a list of where it sees those that it sees, and a loop that adds what came
// of it to the rays.
#pragma once

#include <memory>

#include "protocol/base/image.h"
#include "stitch/table/ray_sampler.h"

namespace nodal::bench {

enum class RaysAre : std::uint8_t { kInOrder, kInNoOrder };

/// I420 heads into an I420 raymap, as the ray samples say; gains are left alone.
///
/// Threading: band() on any number of threads at once.
class OpenCvPeer {
 public:
  OpenCvPeer(const table::RaySampler& sampler, RaysAre rays);
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
