// Runs Hugin's own tools, where they are installed.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "stitch/geometry/head.h"

namespace nodal::interchange {

bool there_is_pano_trafo();

/// The largest distance, in picture pixels, between the pixels that `heads` and Hugin's project give to the same ray,
/// on a grid inside the heads' regions. Infinite, with a failed expectation, if Hugin does not answer.
double worst_disagreement(const std::string& project, const std::vector<geometry::Head>& heads, int panorama_width);

}  // namespace nodal::interchange

#define NODAL_PANO_TRAFO_OR_SKIP() \
  if (!nodal::interchange::there_is_pano_trafo()) GTEST_SKIP() << "pano_trafo is not installed (Debian: hugin-tools)"
