#include "stitch/registration/prepare.h"

#include <algorithm>

#include "protocol/base/try.h"
#include "stitch/parallel/workers.h"
#include "stitch/registration/check_frames.h"
#include "stitch/registration/pyramid.h"

namespace nodal::registration {
namespace {

constexpr int kSmallestLevel = 16;  // px on the shorter side of the coarsest picture

}  // namespace

Result<LitFrames> LitFrames::of(const Calibration& calibration, const std::vector<FrameSet>& frame_sets, Colour colour,
                                int threads) {
  NODAL_TRY(check_frames(calibration, frame_sets));
  const int channels = colour == Colour::kRgb ? 3 : 1;
  std::vector<HeadPyramid> pyramids(calibration.heads.size());
  parallel::Workers(threads).run(static_cast<int>(pyramids.size()), [&](int head) {
    const auto h = static_cast<std::size_t>(head);
    std::vector<Plane> planes;
    for (const FrameSet& frames : frame_sets) {
      for (Plane& plane : light_of(frames[h], calibration.heads[h], channels)) planes.push_back(std::move(plane));
    }
    pyramids[h] = make_pyramid(std::move(planes), kSmallestLevel);
  });
  NODAL_TRY(check_light(calibration, pyramids));
  return LitFrames{frame_sets, colour, std::make_shared<const std::vector<HeadPyramid>>(std::move(pyramids))};
}

Result<Prepared> prepare(const Calibration& calibration, const LitFrames& frames, const Options& options) {
  Prepared ready;
  for (const HeadCalibration& head : calibration.heads) {
    NODAL_TRY_ASSIGN(HeadState state, HeadState::from(head, calibration.distance));
    ready.heads.push_back(std::move(state));
  }
  int deepest = kLevels - 1;
  for (const HeadPyramid& pyramid : *frames.pyramids) {
    deepest = std::min(deepest, static_cast<int>(pyramid.levels.size()) - 1);
  }
  ready.plans = plan_levels(ready.heads, options, deepest);
  return ready;
}

}  // namespace nodal::registration
