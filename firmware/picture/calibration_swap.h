// The swap of calibrations between two sets, on the side of the blend.
#pragma once

#include <cstdint>
#include <utility>

#include "firmware/frame/snapshot.h"
#include "protocol/base/sha256.h"
#include "protocol/base/spsc_ring.h"
#include "stitch/sets/blend_plan.h"
#include "stitch/sets/set_blend.h"

namespace nodal::firmware {

/// The first set that a calibration is in force for.
struct Adoption {
  std::uint64_t first_set = 0;
  Sha256 calibration{};
};

/// Threading: the rings' other ends are the keeper's and the frame sender's, one thread each; adoption() is for
///   control. The other calls are for the thread that coordinates the blend.
/// Errors: none.
class CalibrationSwap {
 public:
  SpscRing<sets::BlendSetup>& tables_in() { return tables_in_; }
  /// Calibrations and seams (these without memory) that are no longer in force; the keeper frees them outside the frame
  /// path.
  SpscRing<sets::BlendSetup>& tables_out() { return tables_out_; }
  SpscRing<Adoption>& adoptions_out() { return adoptions_out_; }
  /// The newest adoption.
  Snapshot<Adoption>& adoption() { return adoption_; }

  /// Puts a calibration that waits in force; true when there was one. Waits while the one before cannot be given back.
  bool adopt(sets::SetBlend& blend) {
    if (tables_out_.full() || adoptions_out_.full()) return false;
    auto setup = tables_in_.pop();
    if (!setup) return false;
    if (sets::BlendSetup before = blend.adopt(std::move(*setup))) tables_out_.push(std::move(before));
    reported_ = false;
    return true;
  }
  /// Reports the calibration in force with its first set; true for that set.
  bool report(std::uint64_t set, const sets::SetBlend& blend) {
    if (std::exchange(reported_, true)) return false;
    Adoption adoption{set, blend.plan()->id};
    adoption_.publish(adoption);
    adoptions_out_.push(std::move(adoption));
    return true;
  }

 private:
  SpscRing<sets::BlendSetup> tables_in_{1};  // a full ring means that the newest calibration is not in force yet
  SpscRing<sets::BlendSetup> tables_out_{8};
  SpscRing<Adoption> adoptions_out_{4};
  Snapshot<Adoption> adoption_;
  bool reported_ = true;
};

}  // namespace nodal::firmware
