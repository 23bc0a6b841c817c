// The steps that table::compile_cost() counts before a table is compiled, beside the seconds that one processor then
// takes.
#include <algorithm>
#include <array>
#include <cstdio>
#include <ctime>
#include <string>
#include <vector>

#include "stitch/table/compile_cost.h"
#include "stitch/table/table_compiler.h"
#include "workloads.h"

namespace nodal::bench {
namespace {

/// Thin masks along the diagonal of every head: the box of each is the whole picture, so that every ray is compared
/// with their corners.
Calibration masked(Calibration rig, int masks) {
  for (HeadCalibration& head : rig.heads) {
    for (int m = 0; m < masks; ++m) {
      std::vector<Region::Point> mask;
      const double across = (head.width - 60) / 7.0, down = (head.height - 60) / 7.0;
      for (int k = 0; k < 8; ++k) mask.push_back({20.0 + m + k * across, 20 + k * down});
      for (int k = 7; k >= 0; --k) mask.push_back({20.5 + m + k * across, 20.2 + k * down});
      head.region.masks.push_back(std::move(mask));
    }
  }
  return rig;
}

void show(const std::string& name, const Calibration& rig, int width) {
  const std::vector<PixelFormat> formats(rig.heads.size(), PixelFormat::kI420);
  const int height = width / 2;
  std::uint64_t steps = 0;
  double best = 1e300;
  for (int run = 0; run < 3; ++run) {
    auto compiler = table::TableCompiler::make(rig, {"equirectangular", width, height, PixelFormat::kI420}, formats);
    if (!compiler) {
      std::printf("%-20s %s\n", name.c_str(), compiler.error().text().c_str());
      return;
    }
    steps = compiler->cost().total;
    const std::clock_t begin = std::clock();  // the processor's time, so that other load counts little
    compiler->compile_rows(0, compiler->row_count());
    best = std::min(best, static_cast<double>(std::clock() - begin) / CLOCKS_PER_SEC);
  }
  const auto pixels = static_cast<std::uint64_t>(width) * static_cast<std::uint64_t>(height);
  const double allowed = static_cast<double>(table::compile_budget(pixels, rig.heads.size()));
  std::printf("%-20s %9d %12.0f %9.2f %12.2f %9.0f %14.1f\n", name.c_str(), width, static_cast<double>(steps) / 1e6,
              best, best * 1e9 / static_cast<double>(steps), 100 * static_cast<double>(steps) / allowed,
              allowed * best / static_cast<double>(steps));
}

}  // namespace
}  // namespace nodal::bench

int main() {
  using namespace nodal::bench;
  std::printf("%-20s %9s %12s %9s %12s %9s %14s\n", "rig", "width, px", "10^6 steps", "s", "ns a step", "budget, %",
              "s at budget");
  for (const int width : {1024, 2048}) {
    show("r8", r8().rig, width);
    show("r10", r10().rig, width);
    show("r10, 2 masks", masked(r10().rig, 2), width);
    show("r10, 8 masks", masked(r10().rig, 8), width);
    show("r10, 16 masks", masked(r10().rig, 16), width);
  }
  return 0;
}
