#include "stitch/registration/drift.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "protocol/base/angles.h"
#include "protocol/base/try.h"
#include "stitch/registration/check_frames.h"
#include "stitch/registration/descent.h"
#include "stitch/registration/level.h"
#include "stitch/registration/prepare.h"

namespace nodal::registration {
namespace {

constexpr double kByChance = 4;   // standard deviations up to which a movement may be chance
constexpr double kKnownWell = 2;  // standard deviations that must fit into the tolerance

HeadDrift drift_of(const HeadCalibration& was, const HeadCalibration& is, const HeadReport& found, double tolerance_px,
                   double focal_px) {
  HeadDrift drift;
  drift.name = found.name;
  drift.sigma_deg = found.sigma_deg;
  drift.sigma_px = found.sigma_deg / kDegreesPerRadian * focal_px;
  if (!found.placed) {
    drift.why = found.why_not;
    return drift;
  }
  const Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>> R_was(was.R_head_rig.data()),
      R_is(is.R_head_rig.data());
  // The matrix takes a ray from the old head frame to the new one: the head itself turned by the inverse.
  const Eigen::AngleAxisd turn(Eigen::Matrix3d(R_was * R_is.transpose()));
  const Eigen::Vector3d about = turn.angle() * turn.axis() * kDegreesPerRadian;
  drift.moved_deg = about.norm();
  drift.moved_px = drift.moved_deg / kDegreesPerRadian * focal_px;
  drift.up_deg = about.x();
  drift.right_deg = about.y();
  drift.roll_deg = about.z();
  // A movement of many standard deviations is certain, even if the measurement is too inaccurate to show a small one.
  const bool beyond_chance = drift.moved_deg > kByChance * drift.sigma_deg;
  if (drift.moved_px > tolerance_px && beyond_chance) {
    drift.standing = Standing::kMoved;
  } else if (kKnownWell * drift.sigma_px > tolerance_px) {
    drift.why = "its overlaps have too little detail to measure its direction";
  } else if (drift.moved_px <= tolerance_px) {
    drift.standing = Standing::kStands;
  } else {
    drift.why = "the measured movement may be chance: take more frames, or another scene";
  }
  return drift;
}

// Makes the mean log gain 0: otherwise a calibration that darkens everything would have smaller differences.
void level_gains(std::vector<HeadState>& heads) {
  for (std::size_t c = 0; c < 3; ++c) {
    double sum = 0;
    for (const HeadState& head : heads) sum += head.log_gain[c];
    for (HeadState& head : heads) head.log_gain[c] -= sum / static_cast<double>(heads.size());
  }
}

}  // namespace

std::string_view standing_name(Standing standing) {
  switch (standing) {
    case Standing::kStands: return "stands";
    case Standing::kMoved: return "moved";
    case Standing::kUnknown: return "unknown";
  }
  return "unknown";
}

bool DriftReport::any(Standing standing) const {
  return std::ranges::any_of(heads, [standing](const HeadDrift& head) { return head.standing == standing; });
}

Result<DriftReport> measure_drift(const Calibration& calibration, const std::vector<FrameSet>& frame_sets,
                                  const DriftOptions& options) {
  Options how;
  how.gauge = Gauge::kMedian;
  how.threads = options.threads;
  how.progress = options.progress;
  NODAL_TRY_ASSIGN(Report found, register_heads(calibration, frame_sets, how));
  DriftReport report;
  for (std::size_t h = 0; h < calibration.heads.size(); ++h) {
    NODAL_TRY_ASSIGN(const HeadState state, HeadState::from(calibration.heads[h], calibration.distance));
    report.heads.push_back(drift_of(calibration.heads[h], found.calibration.heads[h], found.heads[h],
                                    options.tolerance_px, focal_of(state.lens)));
  }
  report.objective_before = found.objective_before;
  report.objective_after = found.objective_after;
  report.calibration = std::move(found.calibration);
  report.warnings = std::move(found.warnings);
  return report;
}

Result<std::vector<double>> objectives_of(const std::vector<Calibration>& calibrations,
                                          const std::vector<FrameSet>& frame_sets, const Options& options) {
  const parallel::Workers workers(options.threads);
  std::vector<double> objectives;
  for (const Calibration& calibration : calibrations) {
    NODAL_TRY_ASSIGN(const LitFrames frames, LitFrames::of(calibration, frame_sets, options.colour, options.threads));
    NODAL_TRY_ASSIGN(Prepared ready, prepare(calibration, frames, options));
    level_gains(ready.heads);
    const LevelPlan& finest = ready.plans.back();
    NODAL_TRY_ASSIGN(std::unique_ptr<Level> level, Level::make(finest, Level::Pictures::kLight, *frames.pyramids,
                                                               ready.heads, options, 0.02, workers));
    Sought gains;
    gains.rotation = gains.vignetting = false;
    gains.channels = options.colour == Colour::kRgb ? 3 : 1;
    Held held;
    held.geometry.assign(ready.heads.size(), true);
    held.light.assign(ready.heads.size(), false);
    held.first = -1;
    NODAL_TRY_ASSIGN(const Descended fitted, descend(level->objective(), ready.heads, gains, held, {}));
    if (fitted.normal.measure <= 0) return fail(Errc::kNoCoverage, nothing_shared(calibration));
    objectives.push_back(fitted.normal.objective());
  }
  return objectives;
}

}  // namespace nodal::registration
