// Diagnoses heads that do not match their neighbours: tries common mistakes and names the one whose correction helps.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "stitch/registration/registration.h"

namespace nodal::registration {

/// Whether the heads agree with these pictures.
using Attempt = std::function<bool(const std::vector<FrameSet>&)>;

/// Turns the pictures of the `wrong` heads upside down, or mirrors them; all heads first, then one by one, until an
/// attempt succeeds. Returns one sentence, or nothing if no attempt succeeds.
std::optional<std::string> usual_mistake(const Calibration& prior, const std::vector<FrameSet>& frame_sets,
                                         const std::vector<std::size_t>& wrong, const Attempt& attempt);

}  // namespace nodal::registration
