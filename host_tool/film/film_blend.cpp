#include "host_tool/film/film_blend.h"

#include <array>
#include <chrono>

#include "protocol/base/try.h"
#include "protocol/base/units.h"
#include "stitch/sets/plan_job.h"
#include "stitch/sets/seam_schedule.h"
#include "stitch/sets/seam_views.h"

namespace nodal::film {

Result<FilmBlend> FilmBlend::make(const FilmPlan& plan, int threads, const std::function<void(double)>& progress) {
  FilmBlend made(threads);
  std::vector<PixelFormat> formats;
  for (const PlannedHead& head : plan.heads) formats.push_back(head.film.format);
  NODAL_TRY_ASSIGN(auto job, sets::PlanJob::make(plan.calibration, plan.raymap, Fields::kProgressive, formats));
  while (!job.tables().done()) {
    job.tables().compile_pieces(2 * made.workers_.threads(),
                                [&](int pieces, const auto& work) { made.workers_.run(pieces, work); });
    if (progress) progress(job.tables().percent() / 100.0);
  }
  NODAL_TRY_ASSIGN(made.own_, std::move(job).finish(calibration_id(plan.calibration)));
  made.blend_.adopt(sets::with_memory(made.own_));
  return made;
}

Status FilmBlend::use(const PlannedSeams* seams) {
  if (seams == nullptr) {
    if (blend_.plan() != own_) blend_.move_seams(own_);
    return {};
  }
  const sets::SeamLabels& now = blend_.plan()->seam_labels;
  if (now && *now == seams->labels) return {};
  NODAL_TRY_ASSIGN(auto seamed, sets::with_seams(*own_, seams->labels));
  blend_.move_seams(std::move(seamed));
  return {};
}

Result<std::vector<std::uint8_t>> FilmBlend::place_seams(std::span<const ImageView> pictures) {
  begin(pictures, true);
  if (!blend_.views()) return std::vector<std::uint8_t>{};
  sets::PlacedSeams placed = sets::place_seams(*blend_.plan(), *blend_.views());
  if (!placed.refused.empty()) return fail(Errc::kTableInvalid, "placing seams: " + placed.refused);
  if (!placed.plan || !placed.plan->seam_labels) return std::vector<std::uint8_t>{};
  blend_.move_seams(placed.plan);
  return *placed.plan->seam_labels;
}

void FilmBlend::begin(std::span<const ImageView> pictures, bool views) {
  std::array<sets::SetFrame, kMaxHeads> frames;
  for (std::size_t h = 0; h < pictures.size(); ++h) {
    const Gain gain = light_.empty() ? Gain{} : gain_of(light_[h]);
    frames[h] = {true, pictures[h], Fields::kProgressive, {}, gain, 0};
  }
  blend_.begin(std::span(frames).first(pictures.size()), views);
  run();
}

void FilmBlend::run() {
  blend_.run_rounds([this](int pieces, const auto& work) { workers_.run(pieces, work); });
}

void FilmBlend::blend(std::span<const ImageView> pictures, std::uint8_t* into) {
  const auto begun = std::chrono::steady_clock::now();
  begin(pictures, false);
  blend_.begin_raymap(0, into);
  run();
  seconds_ += std::chrono::duration<double>(std::chrono::steady_clock::now() - begun).count();
}

}  // namespace nodal::film
