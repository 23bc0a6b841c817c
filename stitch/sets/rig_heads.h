// A rig's heads, as far as its tables depend on them.
#pragma once

#include <optional>
#include <span>
#include <string>

#include "protocol/base/result.h"
#include "protocol/calibration.h"

namespace nodal::sets {

struct RigHead {
  std::string name;
  struct Size {
    int width = 0;  ///< px
    int height = 0;
  };
  std::optional<Size> size;  ///< size of its pictures, if known
};

/// The calibration with its heads in the order of the rig's. `listed_in` names the file with the rig's heads, for
/// errors.
/// Errors: kHeadMismatch for a head that only one of the two has, and for another size.
Result<Calibration> calibration_of(const Calibration& calibration, std::span<const RigHead> rig,
                                   const std::string& listed_in);

}  // namespace nodal::sets
