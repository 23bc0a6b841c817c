// The results of a benchmark, as a table and as JSON.
#pragma once

#include <string>
#include <vector>

namespace nodal::bench {

struct Finding {
  std::string workload;
  std::string variant;
  std::string isa;
  int threads = 1;
  double ms = 0;
  double ratio_to_opencv = 0;  ///< how many times faster; 0 if there is no OpenCV variant
  double roofline_share = 0;   ///< 0 .. 1: the time to read every sample and write every pixel once, divided by ms
  double psnr_db = 0;          ///< against the double-precision blend; 0: not measured
  double max_error = 0;
  double table_bytes_per_pixel = 0;
  double mpixels = 0;         ///< megapixels of the raymap
  double part_with_rays = 1;  ///< share of its pixels that have a ray
};

void print_table(const std::vector<Finding>& findings);
/// The time per pixel of layouts relative to the first, which is equirectangular; lines of other programs are left out.
void print_layouts(const std::vector<Finding>& findings);
std::string to_json(const std::vector<Finding>& findings);

}  // namespace nodal::bench
