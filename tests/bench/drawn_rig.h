// Rigs drawn by a seed, with faults that real rigs have, and whether registration's claims about them are true.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "stitch/registration/registration.h"
#include "tests/support/rendered_rig.h"

namespace nodal::bench {

enum class Fault : std::uint8_t {
  kNone,
  kWeakHead,    ///< one head is out of focus, or has little contrast and much noise
  kSmoothHead,  ///< most of what one head sees is sky, and its neighbours see that sky, too
  kFirstBlind,  ///< the first head sees only sky
  kParallax,    ///< heads 2 to 15 cm off the nodal point, in a room with columns
  kWrongLens,   ///< focal lengths, centres and radial coefficients differ from the calibration's
  kAll,         ///< a weak and a smooth head, parallax, and slightly wrong lenses
};
inline constexpr int kFaults = 7;
inline constexpr double kNoiseLevels = 1;  ///< standard deviation of the noise of all pictures but a weak head's
const char* name_of(Fault fault);

/// A rig, its pictures and how it is to be registered.
struct DrawnRig {
  Fault fault = Fault::kNone;
  Calibration prior;
  test::RenderedRig seen;          ///< what registration gets; `truth` holds the true rotations and lenses
  test::RenderedRig again;         ///< the same scene with other noise
  std::optional<test::Room> room;  ///< the room that it stands in; empty: everything is far away
  std::vector<double> noise;       ///< noise of each head, levels
  registration::Options options;
};
/// The fault and all numbers depend only on the seed; faults take turns.
DrawnRig draw_rig(std::uint64_t seed);

struct HeadClaim {
  std::string name;
  double error_deg = 0;    ///< error of its rotation relative to the head that is held
  double claimed_deg = 0;  ///< the reported standard deviation
  double ratio() const { return error_deg / claimed_deg; }
};

/// What a message may give as the reason why a rig is not registered well.
enum class Reason : std::uint8_t {
  kDetail,  ///< a head shows too little detail
  kNear,    ///< near things, seen by heads that do not stand at one point
  kLens,
};
inline constexpr int kReasons = 3;
struct Reasons {
  bool present = false;  ///< the rig has a fault of this kind
  bool matters = false;  ///< and its effect is above noise (fault_effect.h), so that it has to be named
  bool named = false;    ///< a warning, a head's reason or the error names it
};

struct Verdict {
  std::string refused;            ///< the error; empty if the rig was registered
  std::vector<HeadClaim> placed;  ///< without the head that is held
  std::vector<std::string> not_placed;
  std::vector<std::string> warnings;
  std::array<Reasons, kReasons> reasons{};
  /// Placed heads of which a drift measurement with `again` says that they moved, though none did.
  int false_moves = 0;
  std::string drift_refused;
};
/// Registers the rig. `with_drift`: measures drift from the result, too.
Verdict judge(const DrawnRig& rig, bool with_drift);

}  // namespace nodal::bench
