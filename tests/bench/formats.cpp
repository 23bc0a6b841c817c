// bench_formats [SECONDS]: nodald films r8 (eight 1920x1080 heads into 3840x1920) with heads that deliver I420 or
// MJPEG, at 30 frames a second, without hosts that pull. Prints raymaps a second, the time from a set to its raymap,
// and the processor.
#include <unistd.h>

#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>
#include <thread>

#include "tests/bench/replayed_rig.h"

namespace nodal::bench {
namespace {

/// Processor time of a process and its ended children, s, by /proc/PID/stat.
double processor_s(pid_t pid) {
  std::ifstream file("/proc/" + std::to_string(pid) + "/stat");
  std::string text((std::istreambuf_iterator<char>(file)), {});
  std::istringstream rest(text.substr(text.rfind(')') + 2));
  std::string word;
  double ticks = 0;
  for (int field = 3; field <= 15 && rest >> word; ++field) {
    if (field >= 14) ticks += std::stod(word);
  }
  return ticks / static_cast<double>(::sysconf(_SC_CLK_TCK));
}

void measure(const char* name, PixelFormat format, bool all_chroma_rows, int seconds) {
  ReplayedRig rig(r8(), format, all_chroma_rows, "30");
  const auto daemon = rig.start();
  rig.upload("r8");
  const auto status = [&] { return nlohmann::json::parse(rig.nodal({"--json", "status"})); };
  std::this_thread::sleep_for(std::chrono::seconds(2));
  const auto before = status();
  const double busy = processor_s(daemon->pid());
  std::this_thread::sleep_for(std::chrono::seconds(seconds));
  const auto after = status();
  const double used = processor_s(daemon->pid()) - busy;
  const double raymaps = after["raymaps"].get<double>() - before["raymaps"].get<double>();
  const double clock = (after["uptime_ns"].get<double>() - before["uptime_ns"].get<double>()) / 1e9;
  std::printf("%-12s %8.2f %10.1f %14.2f %16.1f %12.0f\n", name, raymaps / clock, after["blend_ns"].get<double>() / 1e6,
              used / clock, 1000 * used / raymaps, static_cast<double>(rig.picture_bytes()) / 8 / 1024);
}

}  // namespace
}  // namespace nodal::bench

int main(int argc, char** argv) {
  using namespace nodal;
  const int seconds = argc > 1 ? std::atoi(argv[1]) : 10;
  std::printf("%-12s %8s %10s %14s %16s %12s\n", "heads", "raymaps/s", "blend ms", "cores", "CPU ms/raymap",
              "KiB/picture");
  bench::measure("I420", PixelFormat::kI420, false, seconds);
  bench::measure("MJPEG 4:2:0", PixelFormat::kMjpeg, false, seconds);
  bench::measure("MJPEG 4:2:2", PixelFormat::kMjpeg, true, seconds);
}
