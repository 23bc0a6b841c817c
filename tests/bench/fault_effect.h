// What the faults of a drawn rig do to its pictures, computed from the truth alone: a fault that does less than noise
// needs no cause. Shares no code with registration.
#pragma once

#include <vector>

#include "tests/bench/drawn_rig.h"

namespace nodal::bench {

struct FaultEffect {
  /// By how much the fault changes the light that two heads show on a ray, rms over the overlaps, divided by the
  /// pictures' noise. First the fault's displacement is fitted by whatever registration estimates for the rig
  /// (rotations, focal lengths, lenses): what can be compensated has no effect.
  double parallax = 0, lens = 0;
  /// Of each head: the least standard deviation about the worst axis that any estimate of its rotation can have, if
  /// everything else is known, px. From the detail of its picture in the overlaps, and the noise (Cramer and Rao's
  /// bound).
  std::vector<double> head_px;
};
FaultEffect effect_of(const DrawnRig& rig);

}  // namespace nodal::bench
