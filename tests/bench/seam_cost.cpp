// bench_seams: what placed seams cost on r10 and r8, on one thread: processor milliseconds of each step, bytes of the
// tables, and the blend with fixed and with placed seams in turn.
#include <ctime>

#include <algorithm>
#include <cstdio>
#include <functional>
#include <vector>

#include "protocol/take/seam_map.h"
#include "stitch/sets/seam_views.h"
#include "stitch/sets/set_blend.h"
#include "stitch/sets/table_job.h"
#include "tests/bench/workloads.h"

namespace nodal::bench {
namespace {

constexpr int kTimes = 15;

double processor_ms() {
  timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) * 1e3 + static_cast<double>(now.tv_nsec) * 1e-6;
}

double took(const std::function<void()>& work) {
  const double begun = processor_ms();
  work();
  return processor_ms() - begun;
}

double median(std::vector<double> times) {
  std::ranges::sort(times);
  return times[times.size() / 2];
}

std::size_t bytes_of(const std::vector<blend::GridTable>& grids) {
  std::size_t sum = 0;
  for (const blend::GridTable& grid : grids) {
    sum += sizeof(blend::Tile) * grid.tiles.size() + sizeof(blend::PatchRecord) * grid.records.size() +
           2 * (grid.weights.size() + grid.coordinates.size()) + 8 * grid.gains.size() +
           sizeof(blend::LowSight) * grid.low.sights.size();
  }
  return sum;
}

/// What heads with parallax see: every second one another scene, so that pictures disagree all over the overlaps.
std::vector<sets::SetFrame> set_of(const FilmedSet& one, const FilmedSet& other) {
  std::vector<sets::SetFrame> set;
  for (std::size_t h = 0; h < one.heads.size(); ++h) {
    set.push_back({true, (h % 2 == 0 ? one : other).heads[h], {}, Exposure::microseconds(8000), {}, 0});
  }
  return set;
}

void blend_set(sets::SetBlend& blend, const std::vector<sets::SetFrame>& set, std::vector<std::uint8_t>& raymap) {
  blend.begin(set);
  blend.run_rounds();
  blend.begin_raymap(0, raymap.data());
  blend.run_rounds();
}

void measure(const Workload& work) {
  RaymapConfig config;
  config.width = work.raymap.width;
  config.height = work.raymap.height;
  config.seams = SeamPlacement::kPlaced;
  auto job = sets::TableJob::make(work.rig, config, Fields::kProgressive,
                                  std::vector<PixelFormat>(work.rig.heads.size(), PixelFormat::kI420))
                 .value();
  const double compile = took([&] {
    while (!job.done()) job.compile_some(64);
  });
  auto tables = std::move(job).finish().value();
  std::shared_ptr<const sets::SeamViews> views;
  const double make = took([&] { views = sets::SeamViews::make(work.rig, config, tables).value(); });
  const sets::PlanPtr fixed = sets::make_plan({}, work.name, std::move(tables), {}, {}, {}, views);
  std::vector<FilmedSet> films;
  for (std::uint32_t seed = 1; seed <= 3; ++seed) films.push_back(film(work.rig, PixelFormat::kI420, seed));

  sets::SetBlend blend;
  blend.adopt(sets::with_memory(fixed));
  sets::PlanPtr now = fixed;
  seams::Labels labels;
  std::vector<double> view_ms, first_place_ms, first_table_ms, take_bytes, place_ms, still_ms, table_ms, fixed_ms,
      placed_ms;
  std::vector<std::uint8_t> raymap(packed_size(config.format, config.width, config.height));
  for (int k = 0; k < kTimes; ++k) {
    const auto set = set_of(films[static_cast<std::size_t>(k % 3)], films[static_cast<std::size_t>((k + 1) % 3)]);
    blend.begin(set, true);
    view_ms.push_back(took([&] { blend.run_rounds(); }));
    const std::shared_ptr<const sets::SeamPictures> seen = blend.views();
    seams::Labels first;
    first_place_ms.push_back(took([&] { first = views->place(*seen, {}); }));
    first_table_ms.push_back(took([&] { (void)sets::with_seams(*fixed, first).value(); }));
    place_ms.push_back(took([&] { labels = views->place(*seen, labels); }));
    still_ms.push_back(took([&] { labels = views->place(*seen, labels); }));
    table_ms.push_back(took([&] { now = sets::with_seams(*now, labels).value(); }));
    take_bytes.push_back(
        static_cast<double>(take::seams_record(1'000'000, sets::kSeamMapWidth, labels).ByteSizeLong()));
    blend.move_seams(now);
    placed_ms.push_back(took([&] { blend_set(blend, set, raymap); }));
    blend.move_seams(fixed);
    fixed_ms.push_back(took([&] { blend_set(blend, set, raymap); }));
  }
  std::printf(
      "%s: views %.2f ms, placing %.1f (the first), %.1f (all changes) and %.1f (nothing changes), table %.1f (the "
      "first) "
      "and %.1f with its proof, %.0f bytes in a take; prepare "
      "and blend %.2f with fixed "
      "seams, %.2f with placed ones; once: tables %.0f ms, views %.0f\n"
      "  tables: %.2f MB fixed, %.2f placed, cover %.2f\n",
      work.name.c_str(), median(view_ms), median(first_place_ms), median(place_ms), median(still_ms),
      median(first_table_ms), median(table_ms), median(take_bytes), median(fixed_ms), median(placed_ms), compile, make,
      static_cast<double>(bytes_of(fixed->tables[0].grids)) * 1e-6,
      static_cast<double>(bytes_of(now->tables[0].grids)) * 1e-6,
      static_cast<double>(bytes_of(now->tables[0].cover)) * 1e-6);
}

}  // namespace
}  // namespace nodal::bench

int main() {
  nodal::bench::measure(nodal::bench::r10());
  nodal::bench::measure(nodal::bench::r8());
  return 0;
}
