#include "stitch/registration/prepare.h"

#include <algorithm>

#include "stitch/registration/check_frames.h"

namespace nodal::registration {
namespace {

constexpr int kSmallestLevel = 16;  // px on the shorter side of the coarsest picture

}  // namespace

Result<Prepared> prepare(const Calibration& calibration, const std::vector<FrameSet>& frame_sets,
                         const Options& options, const parallel::Workers& workers) {
  if (Status fits = check_frames(calibration, frame_sets); !fits) return fail(fits.error());
  Prepared ready;
  for (const HeadCalibration& head : calibration.heads) {
    Result<HeadState> state = HeadState::from(head, calibration.distance);
    if (!state) return fail(state.error());
    ready.heads.push_back(std::move(*state));
  }
  const int channels = options.colour == Colour::kRgb ? 3 : 1;
  ready.pyramids.resize(ready.heads.size());
  workers.run(static_cast<int>(ready.heads.size()), [&](int head) {
    const auto h = static_cast<std::size_t>(head);
    std::vector<Plane> planes;
    for (const FrameSet& frames : frame_sets) {
      for (Plane& plane : light_of(frames[h], calibration.heads[h], channels)) planes.push_back(std::move(plane));
    }
    ready.pyramids[h] = make_pyramid(std::move(planes), kSmallestLevel);
  });
  if (Status good = check_light(calibration, ready.pyramids); !good) return fail(good.error());
  int deepest = kLevels - 1;
  for (const HeadPyramid& pyramid : ready.pyramids) {
    deepest = std::min(deepest, static_cast<int>(pyramid.levels.size()) - 1);
  }
  ready.plans = plan_levels(ready.heads, options, deepest);
  return ready;
}

}  // namespace nodal::registration
