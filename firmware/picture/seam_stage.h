// The stage that places seams, beside the frame path.
#pragma once

#include <atomic>
#include <cstdint>
#include <memory>

#include "protocol/base/spsc_ring.h"
#include "stitch/sets/seam_schedule.h"

namespace nodal::firmware {

/// The blend does not touch the views until the answer is there.
struct SeamRequest {
  sets::PlanPtr plan;
  std::shared_ptr<const sets::SeamPictures> views;  ///< views of one set
};
using SeamAnswer = sets::PlacedSeams;

/// Places the seams of one set a step; may take longer than a set. A rig with fixed seams gives it no requests.
///
/// Threading: step() thread-bound; the rings' other ends are the blend's; idle() any thread.
/// Ownership: none of the frames. Errors: none.
class SeamStage {
 public:
  SeamStage(SpscRing<SeamRequest>& requests, SpscRing<SeamAnswer>& answers) : requests_(requests), answers_(answers) {}

  /// True when it did something.
  bool step();
  /// No request waits or is being worked on.
  bool idle() const { return !working_.load(std::memory_order_acquire) && requests_.empty(); }

 private:
  SpscRing<SeamRequest>& requests_;
  SpscRing<SeamAnswer>& answers_;
  std::atomic<bool> working_{false};
};

}  // namespace nodal::firmware
