// The page beside a stitched sphere: the sphere itself, what is to be said of it, and the seams that deserve a look.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "host_tool/report/html_report.h"
#include "host_tool/report/verdict.h"
#include "protocol/base/decoded_image.h"
#include "protocol/base/result.h"
#include "stitch/bands/layer.h"
#include "stitch/geometry/raymap/layout.h"

namespace nodal::host {

struct StitchedSphere {
  const DecodedImage& raymap;            ///< all of it, or the part
  const geometry::RaymapLayout& layout;  ///< layout of the whole raymap
  std::optional<bands::Window> part;     ///< the part of an equirectangular raymap that `raymap` shows
  const Verdict& verdict;
  std::vector<std::string> heads;
  std::vector<std::string> notes;  ///< whole sentences
  std::string confidence;          ///< one sentence: how the pictures were placed
};

/// Ownership: the page does not refer to the sphere.
HtmlReport stitch_report(const StitchedSphere& sphere);

}  // namespace nodal::host
