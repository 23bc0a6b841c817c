// Films blended as a rig does whose seams are never late.
#pragma once

#include <cstdint>
#include <memory>
#include <utility>
#include <vector>

#include "stitch/sets/placed_seams.h"
#include "stitch/sets/seam_views.h"
#include "stitch/sets/set_blend.h"
#include "stitch/sets/table_job.h"
#include "stitch/table/tone_compiler.h"
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

inline InstalledPtr installed(const Calibration& rig, SeamPlacement seams) {
  const RaymapConfig config = config_with(seams);
  auto job = TableJob::make(rig, config, Fields::kProgressive,
                            std::vector<PixelFormat>(rig.heads.size(), PixelFormat::kGrey8));
  while (!job->done()) job->compile_some(64);
  auto tables = std::move(*job).finish().value();
  std::shared_ptr<const SeamViews> views;
  if (seams == SeamPlacement::kPlaced) views = SeamViews::make(rig, config, tables).value();
  return make_installed({}, "rig", std::move(tables), {}, table::compile_tone_table(rig, config.format, true), {},
                        std::move(views));
}

inline std::vector<SetFrame> set_of(const test::RenderedRig& seen) {
  std::vector<SetFrame> set;
  for (const ImageView& frame : seen.frames()) set.push_back({true, frame, {}, Exposure::microseconds(8000), {}, 0});
  return set;
}

class Film {
 public:
  Film(const Calibration& rig, SeamPlacement seams) { blend_.adopt(installed(rig, seams)); }

  Bytes blend(const std::vector<SetFrame>& set) {
    const std::uint64_t number = next_++;
    const bool first = number % kSeamPeriod == 0;
    if (first && placed_) {
      blend_.adopt(std::move(placed_));
      ++moved;
    }
    blend_.begin(set);
    if (first && blend_.installed()->seams) {
      blend_.begin_views();
      for (std::size_t k = 0; k < blend_.to_view(); ++k) blend_.view(k);
      placed_ = place_seams(*blend_.installed()).installed;
    }
    Bytes raymap(std::size_t{kWidth} * kWidth / 2);
    blend_.begin_raymap(0, raymap.data());
    for (std::size_t k = 0; k < blend_.to_prepare(); ++k) blend_.prepare(k);
    blend_.blend(0, kWidth / 2);
    return raymap;
  }
  const InstalledCalibration& now() const { return *blend_.installed(); }

  int moved = 0;

 private:
  SetBlend blend_;
  InstalledPtr placed_;
  std::uint64_t next_ = 0;
};

}  // namespace nodal::sets
