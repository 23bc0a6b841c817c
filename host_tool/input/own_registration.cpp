// Registration of pictures whose first calibration is from their points.
#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>

#include "host_tool/input/own_pictures.h"
#include "protocol/base/try.h"
#include "stitch/autocalibration/point_check.h"
#include "stitch/autocalibration/tsai_form.h"

namespace nodal::host {
namespace {

using registration::Free;
using registration::Report;

// Of the raymap that differences are summed on, px:
constexpr int kTriedWidth = 768;     // used for light, and to find out what the pictures determine
constexpr int kRefinedWidth = 2048;  // used for the result
// A start that is right may have a slightly smaller objective, at the width of trials, than what follows from it.
constexpr double kTriedSlack = 1.1;

/// The attempts that together register one set of pictures.
class Attempts {
 public:
  Attempts(const RigPictures& rig, const registration::LitFrames& lit, std::vector<double> points,
           const OwnProgress& progress)
      : rig_(rig), lit_(lit), points_(std::move(points)), progress_(progress) {}

  Result<Report> light() {
    return run(rig_.calibration, Free::kRotations, false, kTriedWidth, 0.2, "matching the light");
  }
  /// Whether a result places every head and agrees with the points as well as the first calibration.
  bool good(const Result<Report>& report) const {
    if (!report) return false;
    const bool placed = std::ranges::all_of(report->heads, [](const auto& head) { return head.placed; });
    const auto after = autocalibration::point_errors(report->calibration, *rig_.match->points);
    return placed && after && autocalibration::agrees_as_well(points_, *after);
  }
  /// At the width of trials.
  Result<Report> tried(Free free) {
    begun_ = 0.2;
    return run(rig_.calibration, free, true, kTriedWidth, 0.1, "trying lenses");
  }
  /// At the width of results.
  Result<Report> fine(const Calibration& from, Free free) {
    return run(from, free, true, kRefinedWidth, 0.7 * (1 - begun_) / 2, "registering the lenses");
  }
  /// From a result, in red, green and blue: details that differ in colour only count, too.
  Result<Report> in_colour(const Calibration& from, Free free) {
    NODAL_TRY_ASSIGN(const registration::LitFrames lit,
                     registration::LitFrames::of(from, {rig_.frames(rig_.match->set)}, registration::Colour::kRgb, 0));
    return run(from, lit, free, true, kRefinedWidth, 1 - begun_, "registering the colours");
  }
  bool better(const Result<Report>& other, const Report& than, double slack = 1) const {
    return good(other) && other->objective_after < slack * than.objective_after;
  }
  Report with_best_model(Report best);

 private:
  Result<Report> run(const Calibration& from, Free free, bool geometry, int width, double share,
                     const std::string& what) {
    return run(from, lit_, free, geometry, width, share, what);
  }
  Result<Report> run(const Calibration& from, const registration::LitFrames& lit, Free free, bool geometry, int width,
                     double share, const std::string& what) {
    registration::Options options;
    options.colour = lit.colour;
    options.free = free;
    options.aspect = rig_.calibration.heads.front().aspect != 1;
    options.geometry = geometry;
    options.search = false;
    options.diagnose = false;  // the points agree, so the pictures are the right way round
    options.width = width;
    options.progress = [&](const registration::Step&, double done) {
      furthest_ = std::max(furthest_, begun_ + share * done);
      progress_(furthest_, what);
    };
    Result<Report> report = registration::register_heads(from, lit, options);
    begun_ += share;
    return report;
  }

  const RigPictures& rig_;
  const registration::LitFrames& lit_;
  std::vector<double> points_;  ///< errors with the first calibration
  const OwnProgress& progress_;
  double begun_ = 0, furthest_ = 0;
};

// Registration does not change the lenses' model. Which one fits them is seen in the finest detail only.
Report Attempts::with_best_model(Report best) {
  const std::optional<Calibration> tsai = autocalibration::with_tsai_lenses(best.calibration);
  if (!tsai) return best;
  Result<Report> other = fine(*tsai, Free::kLens);
  return better(other, best) ? std::move(*other) : best;
}

}  // namespace

Result<Report> refined(const RigPictures& rig, const OwnProgress& progress) {
  NODAL_TRY_ASSIGN(
      const registration::LitFrames lit,
      registration::LitFrames::of(rig.calibration, {rig.frames(rig.match->set)}, registration::Colour::kLuminance, 0));
  NODAL_TRY_ASSIGN(std::vector<double> points, autocalibration::point_errors(rig.calibration, *rig.match->points));
  Attempts attempts(rig, lit, std::move(points), progress);
  NODAL_TRY_ASSIGN(Report light, attempts.light());
  std::optional<Report> best;
  Free chosen = Free::kLens;
  for (const Free free : {Free::kLens, Free::kFocals, Free::kRotations}) {
    if (!rig.match->lens.mostly && free != Free::kRotations) continue;
    Result<Report> tried = attempts.tried(free);
    if (!attempts.better(tried, light, kTriedSlack)) continue;
    const bool sure = attempts.better(tried, light);
    Result<Report> fine = attempts.fine(tried->calibration, free);
    if (attempts.good(fine)) {
      if (!best || fine->objective_after < best->objective_after) {
        best = std::move(*fine);
        chosen = free;
      }
    } else if (sure && !best) {
      return tried;
    }
    if (sure) break;
  }
  if (!best) return light;
  if (chosen == Free::kLens) best = attempts.with_best_model(std::move(*best));
  Result<Report> colour = attempts.in_colour(best->calibration, chosen);
  if (attempts.good(colour)) best = std::move(*colour);
  return std::move(*best);
}

Report registered_alone(const RigPictures& rig, const OwnProgress& progress) {
  Result<Report> found = refined(rig, progress);
  if (found) return std::move(*found);
  Report by_points;
  by_points.calibration = rig.calibration;
  for (const HeadCalibration& head : rig.calibration.heads) {
    by_points.heads.push_back({});
    by_points.heads.back().name = head.name;
    by_points.heads.back().sigma_deg = std::numeric_limits<double>::infinity();
  }
  by_points.warnings.push_back("the pictures' light is not matched: " + found.error().message);
  return by_points;
}

}  // namespace nodal::host
