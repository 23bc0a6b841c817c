// What the benchmark found, as a table to read and as JSON to keep.
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
  double ratio_to_opencv = 0;  ///< how many times quicker; 0 where there is nothing to compare with
  double roofline_share = 0;   ///< of 1: what reading every sample and writing every pixel once would take, by ms
  double psnr_db = 0;          ///< against the double-precision blend; 0: not measured
  double max_error = 0;
  double table_bytes_per_pixel = 0;
  double mpixels = 0;  ///< of the raymap
};

void print_table(const std::vector<Finding>& findings);
std::string to_json(const std::vector<Finding>& findings);

}  // namespace nodal::bench
