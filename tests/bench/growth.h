// How the blend's cost grows: with the raymap's pixels, with how much the heads overlap, with how many they are, and
// with threads.
#pragma once

#include <string>
#include <vector>

#include "report.h"

namespace nodal::bench {

/// Measures every point, adds it to `findings`, and writes pixels.svg, overlap.svg, heads.svg and threads.svg, each with
/// the law that its points follow, to `folder`, which is made when it is not there. False when they could not be written.
bool measure_growth(const std::string& folder, bool quick, std::vector<Finding>& findings);

}  // namespace nodal::bench
