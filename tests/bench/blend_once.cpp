// blend_once KERNEL [--light]: blends one raymap of r10 with one thread, for a profiler that counts instructions. Only
// those of the blend count (callgrind --instr-atstart=no). Prints the number of the raymap's pixels.
#include <CLI/CLI.hpp>
#include <cstdio>
#if __has_include(<valgrind/callgrind.h>)
#include <valgrind/callgrind.h>
#else
#define CALLGRIND_START_INSTRUMENTATION (void)0
#define CALLGRIND_STOP_INSTRUMENTATION (void)0
#endif

#include "frames.h"
#include "stitch/table/table_compiler.h"
#include "tests/bench/workloads.h"

namespace nodal::bench {
namespace {

/// Pictures with random samples: a kernel's cost hardly depends on the samples.
FilmedSet noise(const Calibration& rig) {
  FilmedSet set;
  std::uint32_t state = 1;
  for (const HeadCalibration& head : rig.heads) {
    std::vector<std::uint8_t>& memory =
        set.memory.emplace_back(packed_size(PixelFormat::kI420, head.width, head.height));
    for (std::uint8_t& sample : memory)
      sample = static_cast<std::uint8_t>((state = state * 1664525U + 1013904223U) >> 24);
    set.heads.push_back(packed_image(PixelFormat::kI420, head.width, head.height, std::as_const(memory).data()));
  }
  return set;
}

void blend(blend::Kernel kernel, bool light) {
  const Workload work = r10();
  const std::vector<PixelFormat> formats(work.rig.heads.size(), PixelFormat::kI420);
  const blend::BlendTable table = table::compile_blend_table(work.rig, work.raymap, formats, options_of(light)).value();
  blend::SetTone tone = blend::calibrated_tone(table);
  if (light) add_curves(tone);
  const FilmedSet set = noise(work.rig);
  Levels levels(table);
  Pool alone(1);
  const blend::Pictures pictures = levels.make(set.heads, alone);
  const Outputs out(PixelFormat::kI420, table.width, table.height);
  CALLGRIND_START_INSTRUMENTATION;
  blend_frame(kernel, table, pictures, tone, out.at(0), alone);
  CALLGRIND_STOP_INSTRUMENTATION;
  std::printf("%d\n", table.width * table.height);
}

}  // namespace
}  // namespace nodal::bench

int main(int argc, char** argv) {
  CLI::App app("Blends one raymap of r10, for a profiler that counts instructions.");
  std::string name;
  bool light = false;
  app.add_option("kernel", name, "scalar, avx2, ..")->required();
  app.add_flag("--light", light, "with tone curves and gains");
  CLI11_PARSE(app, argc, argv);
  for (const nodal::blend::Kernel kernel : nodal::blend::kernels()) {
    if (nodal::blend::kernel_name(kernel) != name) continue;
    nodal::bench::blend(kernel, light);
    return 0;
  }
  std::fprintf(stderr, "blend_once: no kernel \"%s\" runs here\n", name.c_str());
  return 1;
}
