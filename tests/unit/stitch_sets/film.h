// Films blended as a rig does whose seams are never late.
#pragma once

#include <cstdint>
#include <memory>
#include <utility>
#include <vector>

#include "stitch/sets/plan_job.h"
#include "stitch/sets/seam_schedule.h"
#include "stitch/sets/set_blend.h"
#include "tests/support/rendered_rig.h"

namespace nodal::sets {

inline constexpr int kWidth = 256;
using Bytes = std::vector<std::uint8_t>;

inline RaymapConfig config_with(SeamPlacement seams) {
  RaymapConfig config;
  config.width = kWidth;
  config.height = kWidth / 2;
  config.format = PixelFormat::kGrey8;
  config.seams = seams;
  return config;
}

inline PlanPtr plan_of(const Calibration& rig, SeamPlacement seams) {
  auto job = PlanJob::make(rig, config_with(seams), Fields::kProgressive,
                           std::vector<PixelFormat>(rig.heads.size(), PixelFormat::kGrey8))
                 .value();
  while (!job.tables().done()) job.tables().compile_some(64);
  return std::move(job).finish({}).value();
}

inline std::vector<SetFrame> set_of(const test::RenderedRig& seen) {
  std::vector<SetFrame> set;
  for (const ImageView& frame : seen.frames()) set.push_back({true, frame, {}, Exposure::microseconds(8000), {}, 0});
  return set;
}

class Film {
 public:
  Film(const Calibration& rig, SeamPlacement seams) { blend_.adopt(with_memory(plan_of(rig, seams))); }

  Bytes blend(const std::vector<SetFrame>& set) {
    const std::uint64_t number = next_++;
    if (schedule_.due(number)) {
      if (PlanPtr placed = schedule_.take().plan) {
        blend_.move_seams(std::move(placed));
        ++moved;
      }
    }
    blend_.begin(set, blend_.plan()->seams && schedule_.wants(number));
    blend_.run_rounds();
    if (blend_.views()) {
      newest_views = blend_.views();
      schedule_.begin(number);
      schedule_.placed(place_seams(*blend_.plan(), *newest_views));
    }
    Bytes raymap(std::size_t{kWidth} * kWidth / 2);
    blend_.begin_raymap(0, raymap.data());
    blend_.run_rounds();
    return raymap;
  }
  const BlendPlan& now() const { return *blend_.plan(); }

  int moved = 0;
  std::shared_ptr<const SeamPictures> newest_views;

 private:
  SetBlend blend_;
  SeamSchedule schedule_;
  std::uint64_t next_ = 0;
};

}  // namespace nodal::sets
