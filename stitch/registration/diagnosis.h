// Diagnosis of heads that do not match their neighbours: tries the usual mistakes and names the one that helps.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "stitch/registration/registration.h"

namespace nodal::registration {

/// Whether the heads agree when their pictures are these.
using Attempt = std::function<bool(const std::vector<FrameSet>&)>;

/// Turns the pictures of the `wrong` heads upside down or left for right, all of them and then one by one, until an
/// attempt succeeds. One sentence, or nothing when none does.
std::optional<std::string> usual_mistake(const Calibration& prior, const std::vector<FrameSet>& frame_sets,
                                         const std::vector<std::size_t>& wrong, const Attempt& attempt);

}  // namespace nodal::registration
