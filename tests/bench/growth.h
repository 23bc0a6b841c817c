// How the blend's cost grows with the raymap's pixels, with the heads' overlap, with the number of heads, and with the
// number of threads.
#pragma once

#include <string>
#include <vector>

#include "report.h"

namespace nodal::bench {

/// Measures every point, adds it to `findings`, and writes pixels.svg, overlap.svg, heads.svg and threads.svg, each
/// with the law fitted to its points, to `folder`, which is created if needed. Returns false if they cannot be written.
bool measure_growth(const std::string& folder, bool quick, std::vector<Finding>& findings);

}  // namespace nodal::bench
