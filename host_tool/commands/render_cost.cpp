#include "host_tool/commands/render_cost.h"

#include <fmt/format.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <limits>
#include <string>
#include <string_view>

#include "host_tool/console/quantities.h"
#include "protocol/files/open_file.h"
#include "stitch/blend/blend_table.h"
#include "stitch/geometry/raymap/registry.h"
#include "stitch/sets/table_job.h"

namespace nodal::host {
namespace {

constexpr double kTrialPixels = 512.0 * 256.0;
constexpr double kTwice = 2;         // joining a table's rows needs its memory twice (TableJob)
constexpr double kPictureBytes = 6;  // a pixel of a head: as delivered, decoded, and its smaller levels
constexpr double kRaymapBytes = 12;  // a pixel of the raymap: as blended, and as it is encoded
constexpr int kAllRows = 1 << 16;    // more than a table has
constexpr double kSayPart = 0.25;    // share of the free memory above which the cost is told
constexpr double kSaySeconds = 10;

template <class... Lists>
double bytes_of_lists(const Lists&... lists) {
  return (static_cast<double>(lists.size() * sizeof(lists[0])) + ...);
}

double bytes_of(const blend::BlendTable& table) {
  double bytes = 0;
  const auto add = [&](const blend::GridTable& grid) {
    bytes +=
        bytes_of_lists(grid.tiles, grid.records, grid.weights, grid.coordinates, grid.gains, grid.places, grid.runs,
                       grid.slots, grid.low.first_point, grid.low.first_sight, grid.low.sights, grid.low.cells);
  };
  for (const blend::GridTable& grid : table.grids) add(grid);
  for (const blend::GridTable& grid : table.cover) add(grid);
  return bytes;
}

double pixels_of(const RaymapConfig& raymap) { return double{1} * raymap.width * raymap.height; }

/// The raymap with about kTrialPixels, or as it is if that has fewer.
RaymapConfig trial_of(const RaymapConfig& raymap) {
  const double shrink = std::sqrt(kTrialPixels / pixels_of(raymap));
  const Result<geometry::LayoutName> layout = geometry::LayoutName::parse(raymap.layout);
  if (shrink >= 1 || !layout) return raymap;
  RaymapConfig trial = raymap;
  const geometry::RaymapSize size = layout->size_for_width(raymap.width * shrink);
  trial.width = size.width;
  trial.height = size.height;
  return trial;
}

std::uint64_t kilobytes_of(const char* file, const std::string& key) {
  const Result<FilePtr> lines = open_to_read(file);
  std::array<char, 256> line{};
  while (lines && std::fgets(line.data(), line.size(), lines->get()) != nullptr) {
    if (std::string_view(line.data()).starts_with(key)) return std::strtoull(line.data() + key.size(), nullptr, 10);
  }
  return 0;
}

}  // namespace

std::optional<RenderCost> cost_of(const std::vector<const Calibration*>& calibrations, const RaymapConfig& raymap,
                                  int threads) {
  const RaymapConfig trial = trial_of(raymap);
  const double ratio = pixels_of(raymap) / pixels_of(trial);
  RenderCost most;
  for (const Calibration* calibration : calibrations) {
    const auto begin = std::chrono::steady_clock::now();
    const Fields fields = trial.raymaps_a_set() > 1 ? Fields::kTopFirst : Fields::kProgressive;
    auto job = sets::TableJob::make(*calibration, trial, fields,
                                    std::vector<PixelFormat>(calibration->heads.size(), in_8_bits(trial.format)));
    if (!job) return std::nullopt;
    while (!job->done()) job->compile_some(kAllRows);
    const auto tables = std::move(*job).finish();
    if (!tables) return std::nullopt;
    const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
    double bytes = 0;
    for (const blend::BlendTable& table : *tables) bytes += bytes_of(table);
    bytes *= kTwice * ratio;
    for (const HeadCalibration& head : calibration->heads) bytes += kPictureBytes * head.width * head.height;
    bytes += kRaymapBytes * pixels_of(raymap);
    most.bytes = std::max(most.bytes, static_cast<std::uint64_t>(bytes));
    most.seconds = std::max(most.seconds, seconds * ratio / std::max(1, threads));
  }
  return most;
}

std::uint64_t free_memory() {
  constexpr std::uint64_t kKiB = 1024;
  std::uint64_t free = kilobytes_of("/proc/meminfo", "MemAvailable:") * kKiB;
  if (free == 0) free = std::numeric_limits<std::uint64_t>::max();
  rlimit limit{};
  if (::getrlimit(RLIMIT_AS, &limit) != 0 || limit.rlim_cur == RLIM_INFINITY) return free;
  const std::uint64_t used = kilobytes_of("/proc/self/status", "VmSize:") * kKiB;
  return std::min(free, limit.rlim_cur > used ? std::uint64_t{limit.rlim_cur} - used : 0);
}

Status check_cost(const RenderCost& cost, const RaymapConfig& raymap, std::uint64_t free) {
  if (cost.bytes <= free) return {};
  // Nearly all of the cost grows with the number of pixels.
  const double part = static_cast<double>(free) / static_cast<double>(cost.bytes);
  const int width = static_cast<int>(0.9 * raymap.width * std::sqrt(part)) / 16 * 16;
  const std::string advice = width >= 16 ? fmt::format("try --width {}", width) : "close other programs";
  return fail(
      Errc::kTooLarge,
      fmt::format("a raymap of {}x{} pixels needs about {} of memory and {:.0f} s to prepare, and {} are free; {}",
                  raymap.width, raymap.height, show_bytes(cost.bytes), cost.seconds, show_bytes(free), advice));
}

bool is_worth_saying(const RenderCost& cost, std::uint64_t free) {
  return static_cast<double>(cost.bytes) > kSayPart * static_cast<double>(free) || cost.seconds > kSaySeconds;
}

}  // namespace nodal::host
