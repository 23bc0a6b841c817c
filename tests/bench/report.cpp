#include "report.h"

#include <cstdio>
#include <nlohmann/json.hpp>

namespace nodal::bench {

void print_table(const std::vector<Finding>& findings) {
  std::printf("%-9s %-28s %-7s %7s %9s %9s %8s %9s %7s %7s %7s\n", "workload", "variant", "isa", "threads", "ms",
              "Mpixel/s", "x OpenCV", "roofline", "B/pixel", "PSNR", "error");
  for (const Finding& f : findings) {
    std::printf("%-9s %-28s %-7s %7d %9.3f %9.0f %8.2f %8.1f%% %7.2f %7.2f %7.2f\n", f.workload.c_str(),
                f.variant.c_str(), f.isa.c_str(), f.threads, f.ms, f.mpixels / f.ms * 1e3, f.ratio_to_opencv,
                100 * f.roofline_share, f.table_bytes_per_pixel, f.psnr_db, f.max_error);
  }
}

void print_layouts(const std::vector<Finding>& findings) {
  std::printf("%-20s %7s %8s %9s %9s %9s\n", "layout", "Mpixel", "rays", "ns/pixel", "relative", "x OpenCV");
  const double first = findings.front().ms / findings.front().mpixels;
  for (const Finding& f : findings) {
    if (f.isa == "native") continue;
    std::printf("%-20s %7.3f %7.1f%% %9.3f %9.2f", f.variant.c_str(), f.mpixels, 100 * f.part_with_rays,
                f.ms / f.mpixels, f.ms / f.mpixels / first);
    if (f.ratio_to_opencv > 0) std::printf(" %9.2f", f.ratio_to_opencv);
    std::printf("\n");
  }
}

std::string to_json(const std::vector<Finding>& findings) {
  nlohmann::ordered_json list = nlohmann::ordered_json::array();
  for (const Finding& f : findings) {
    list.push_back({{"workload", f.workload},
                    {"variant", f.variant},
                    {"isa", f.isa},
                    {"threads", f.threads},
                    {"ms", f.ms},
                    {"ratio_to_opencv", f.ratio_to_opencv},
                    {"roofline_share", f.roofline_share},
                    {"psnr_db", f.psnr_db},
                    {"max_error", f.max_error},
                    {"table_bytes_per_pixel", f.table_bytes_per_pixel}});
  }
  return list.dump(2) + "\n";
}

}  // namespace nodal::bench
