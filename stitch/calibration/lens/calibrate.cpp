#include "stitch/calibration/lens/calibrate.h"

#include <fmt/format.h>

#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <numbers>

#include "protocol/base/angles.h"
#include "protocol/base/try.h"
#include "stitch/calibration/lens/find_pattern.h"
#include "stitch/calibration/lens/photometry.h"
#include "stitch/calibration/lens/region.h"

namespace nodal::calibration {
namespace {

constexpr double kMinExplained = 0.6;  // share of a photograph's variance
constexpr double kMinTilt = 4 * kRadiansPerDegree;
constexpr double kMaxFocalDeviation = 0.003;
constexpr double kHopeless = 0.03;  // deviation after kQuick; kThorough divides it by five, not by ten
constexpr std::size_t kMinViews = 2;
constexpr double kAlikeTurn = 3 * kRadiansPerDegree;  // photographs that differ by less count as one view
constexpr double kAlikeMove = 0.03;                   // share of the pattern's distance
constexpr double kWellCovered = 0.95;
constexpr std::size_t kLightSamples = 8'000;  // per photograph, at least

std::string text(double value, const char* format = "%.3g") {
  char buffer[48];
  std::snprintf(buffer, sizeof buffer, format, value);
  return buffer;
}

double light_of(double e) { return e <= 0.04045 ? e / 12.92 : std::pow((e + 0.055) / 1.055, 2.4); }

/// The pattern as light: blur mixes light, not encoded values.
GreyImage pattern_light(const PatternRaster& raster) {
  std::array<float, 256> light;
  for (std::size_t v = 0; v < 256; ++v) light[v] = static_cast<float>(light_of(static_cast<double>(v) / 255));
  GreyImage image(raster.width, raster.height);
  for (std::size_t i = 0; i < raster.values.size(); ++i) image.values[i] = light[raster.values[i]];
  return image;
}

Status check_count(std::size_t photographs) {
  if (photographs >= kMinViews) return {};
  return fail(Errc::kNotDetermined, fmt::format("{} photograph{} too few; take three or more, with the pattern "
                                                "turned by 20 to 40 degrees, to different sides",
                                                photographs, photographs == 1 ? " is" : "s are"));
}

Status check_photographs(const std::vector<LensPhotograph>& photographs) {
  NODAL_TRY(check_count(photographs.size()));
  for (const LensPhotograph& photo : photographs) {
    const GreyImage& first = photographs[0].luma;
    if (photo.luma.width != first.width || photo.luma.height != first.height) {
      return fail(Errc::kBadValue,
                  fmt::format("{}: is {}x{} px, but {} is {}x{}; photographs of one head have one size", photo.name,
                              photo.luma.width, photo.luma.height, photographs[0].name, first.width, first.height));
    }
    if (std::min(photo.luma.width, photo.luma.height) < 120) {
      return fail(Errc::kBadValue, fmt::format("{}: is {}x{} px; less than 120 px across is too small", photo.name,
                                               photo.luma.width, photo.luma.height));
    }
  }
  return {};
}

/// Fits on points: first poses and focal length with centre and aspect held, then all unknowns. Returns the pairs that
/// fit.
std::vector<std::vector<PointPair>> refine_start(const std::vector<RadialPose>& radial, bool aspect_known,
                                                 Arrangement& arrangement) {
  std::vector<std::vector<PointPair>> pairs;
  pairs.reserve(radial.size());
  for (const RadialPose& pose : radial) pairs.push_back(pose.inliers);
  std::vector<bool> fixed(static_cast<std::size_t>(arrangement.lens.count), false);
  fixed[kCenterX] = fixed[kCenterY] = fixed[kAspect] = true;
  refine_on_points(pairs, fixed, 5, arrangement);
  fixed[kCenterX] = fixed[kCenterY] = false;
  fixed[kAspect] = aspect_known;
  refine_on_points(pairs, fixed, 3, arrangement);
  refine_on_points(pairs, fixed, 1, arrangement);
  return pairs;
}

double tilt_of(const Pose& pose) { return std::acos(std::clamp(pose.R(2, 2), -1.0, 1.0)); }

/// Photographs from one place count as one view: more of them reduce the computed deviation, but not the true error.
Status check_views_differ(const std::vector<Pose>& poses) {
  const Pose& first = poses[0];
  double turn = 0, move = 0;
  for (const Pose& pose : poses) {
    const double chord = (pose.R - first.R).norm() / (2 * std::numbers::sqrt2);
    turn = std::max(turn, 2 * std::asin(std::min(1.0, chord)));
    move = std::max(move, (pose.t - first.t).norm() / first.t.norm());
  }
  if (turn > kAlikeTurn || move > kAlikeMove) return {};
  return fail(
      Errc::kNotDetermined,
      fmt::format(
          "all {} photographs are taken from one place (they differ by at most {} degrees and {} % of the distance), "
          "which is one view of the pattern; turn it by 20 to 40 degrees between them, to different sides",
          poses.size(), text(turn / kRadiansPerDegree, "%.1f"), text(100 * move, "%.1f")));
}

/// The standard deviation of a ray's pixel that follows from the unknowns' covariance, px rms over the region.
double mapping_deviation(const LensParameters& lens, const Eigen::MatrixXd& covariance, const Region& region) {
  const SightFinder finder(lens);
  const Eigen::MatrixXd C = covariance.topLeftCorner(lens.count, lens.count);
  double sum = 0;
  int count = 0;
  constexpr int kGrid = 24;
  for (int j = 0; j < kGrid; ++j) {
    for (int i = 0; i < kGrid; ++i) {
      const geometry::Pixel p{region.left + (i + 0.5) / kGrid * (region.right - region.left),
                              region.top + (j + 0.5) / kGrid * (region.bottom - region.top)};
      const auto sight = finder.at(p);
      if (!sight) continue;
      const Eigen::Matrix2d N = sight->by_pixel.transpose() * sight->by_pixel;
      const Eigen::Matrix<double, 2, kMaxLensParameters> D =
          N.inverse() * sight->by_pixel.transpose() * sight->by_parameter;
      const Eigen::MatrixXd moved = D.leftCols(lens.count);
      sum += (moved * C * moved.transpose()).trace();
      ++count;
    }
  }
  return std::sqrt(sum / std::max(count, 1));
}

Status check_fits(const std::vector<LensPhotograph>& photographs, const std::vector<DenseFit>& fits) {
  for (std::size_t v = 0; v < fits.size(); ++v) {
    if (fits[v].explained >= kMinExplained) continue;
    return fail(Errc::kNotDetermined,
                photographs[v].name + ": the pattern was found, but explains only " +
                    text(100 * std::max(0.0, fits[v].explained), "%.0f") +
                    " % of this photograph; it moved while it was taken, the pattern is not flat, something stands "
                    "before it, or this is another head or another lens model. Leave it out, or try another --model");
  }
  return {};
}

Status check_determined(const Arrangement& arrangement, const LensReport& report) {
  double tilt = 0;
  for (const Pose& pose : arrangement.poses) tilt = std::max(tilt, tilt_of(pose));
  const double part = report.focal.deviation / report.focal.value;
  if (tilt >= kMinTilt && part <= kMaxFocalDeviation) return {};
  return fail(Errc::kNotDetermined,
              "the focal length is not determined (" + text(report.focal.value, "%.1f") + " px, give or take " +
                  text(100 * part) + " %; the most tilted photograph is tilted by " +
                  text(tilt / kRadiansPerDegree, "%.1f") +
                  " degrees): focal length and distance look alike head on; take some with the pattern turned by 20 "
                  "to 40 degrees, to different sides");
}

void fill_head(const DenseState& state, const Region& region, const LensOptions& options, int width, int height,
               HeadCalibration& head) {
  const LensParameters& lens = state.arrangement.lens;
  head.name = options.head_name;
  head.width = width;
  head.height = height;
  head.center_x = lens[kCenterX];
  head.center_y = lens[kCenterY];
  head.aspect = lens[kAspect];
  head.lens = lens.model();
  head.region = region;
}

void fill_photometry(const std::vector<std::vector<LightSample>>& calm, LensCalibration& out) {
  std::vector<LightSample> samples;
  for (const std::vector<LightSample>& view : calm) {
    const std::size_t stride = std::max<std::size_t>(1, view.size() / kLightSamples);
    for (std::size_t i = 0; i < view.size(); i += stride) samples.push_back(view[i]);
  }
  HeadCalibration& head = out.head;
  const double radius = std::hypot(head.width, head.height / head.aspect) / 2;
  const Photometry photometry = fit_photometry(samples, static_cast<int>(calm.size()), head, radius);
  head.response = photometry.response;
  head.vignetting = {head.center_x, head.center_y, radius, photometry.vignetting};
  for (std::size_t v = 0; v < calm.size(); ++v) out.report.views[v].gain = photometry.gains[v];
  if (check_head(head)) return;
  // A fall-off that turns back where no pixel of the pattern was seen is an extrapolation error and is dropped.
  head.vignetting.coefficients = {};
  out.report.notes.push_back("the light's fall-off came out impossible and is left out; light the pattern more evenly");
}

/// A lens that turns back inside its picture, in an area without measurements, is limited at the turning point.
Status cut_at_turning_point(const LensParameters& lens, LensCalibration& out) {
  const Status checked = check_head(out.head);
  if (checked || checked.error().code != Errc::kLensDomain) return checked;
  const double r = 0.98 * SightFinder(lens).max_radius() * std::min(1.0, lens[kAspect]);
  out.head.region.circle = Region::Circle{out.head.center_x, out.head.center_y, r};
  out.report.notes.push_back("the lens's model ends inside the picture, " + text(r, "%.0f") +
                             " px from its centre, and so does its region; another --model may reach further");
  return check_head(out.head);
}

void add_notes(const LensOptions& options, LensReport& report) {
  if (report.views.size() < 3) {
    report.notes.push_back(fmt::format(
        "{} photographs determine little more than they must; three or more show what is off", report.views.size()));
  }
  if (report.covered < kWellCovered) {
    report.notes.push_back("the pattern was seen over " + text(100 * report.covered, "%.0f") +
                           " % of the picture only, " + text(report.seen_from_px, "%.0f") + " to " +
                           text(report.seen_to_px, "%.0f") +
                           " px from the lens's centre; elsewhere the lens is extrapolated. Go closer, or aim so that "
                           "it fills the corners too");
  }
  if (!options.aspect_known && report.aspect.deviation > 0.002) {
    report.notes.push_back("the aspect ratio is not well determined; give it with --aspect when it is known");
  }
}

}  // namespace

Result<LensCalibration> calibrate_lens(const std::vector<LensPhotograph>& photographs, const PatternRaster& pattern,
                                       const LensOptions& options) {
  NODAL_TRY(check_photographs(photographs));
  const auto tell = [&](const std::string& what, double done) {
    if (options.progress) options.progress(what, done);
  };
  std::vector<GreyImage> lumas;
  std::vector<const GreyImage*> pictures;
  lumas.reserve(photographs.size());
  pictures.reserve(photographs.size());
  for (const LensPhotograph& photo : photographs) lumas.push_back(photo.luma);
  for (const GreyImage& luma : lumas) pictures.push_back(&luma);
  const Region region = find_region(pictures);
  const Eigen::Vector2d center = region.circle ? Eigen::Vector2d(region.circle->x, region.circle->y)
                                               : Eigen::Vector2d(lumas[0].width / 2.0, lumas[0].height / 2.0);
  const auto views = static_cast<int>(photographs.size());

  tell("looking for the pattern", 0);
  const PatternFinder finder(pattern);
  std::vector<Result<RadialPose>> found(photographs.size(), fail(Errc::kInternal, ""));
  options.for_each(views, [&](int v) {
    const auto n = static_cast<std::size_t>(v);
    found[n] = finder.find(lumas[n], photographs[n].name, center, options.aspect);
  });
  std::vector<RadialPose> radial;
  for (const Result<RadialPose>& pose : found) {
    if (!pose) return fail(pose.error());
    radial.push_back(*pose);
  }
  tell("a first lens", 0.15);
  NODAL_TRY_ASSIGN(Arrangement start, first_arrangement(radial, options.kind, center, options.aspect));
  refine_start(radial, options.aspect_known, start);
  NODAL_TRY(check_views_differ(start.poses));

  const ScaleSpace light(pattern_light(pattern));
  DenseAlignment dense(light, lumas, region, options.for_each);
  DenseState state{std::move(start), std::vector<double>(photographs.size(), std::log(0.8))};
  std::vector<bool> fixed(static_cast<std::size_t>(state.arrangement.lens.count), false);
  fixed[kAspect] = options.aspect_known;
  for (int level = dense.coarsest(); level > 0; --level) {
    tell(fmt::format("aligning pixels at 1/{}", 1 << level), 0.25);
    dense.run(level, kQuick, fixed, state);
  }
  const LensParameters& lens = state.arrangement.lens;
  tell("aligning pixels", 0.4);
  solve::Evaluation end = dense.run(0, kQuick, fixed, state);
  const double variance = covariance(end, fixed)(kFirstCoefficient, kFirstCoefficient);
  if (variance <= std::pow(kHopeless * lens[kFirstCoefficient], 2)) {
    tell("aligning every pixel", 0.5);
    end = dense.run(0, kThorough, fixed, state);
  }
  tell("light and uncertainties", 0.9);
  DenseSurvey survey = dense.survey(state);
  NODAL_TRY(check_fits(photographs, survey.fits));

  LensCalibration out;
  const Eigen::MatrixXd C = covariance(end, fixed);
  const auto measured = [&](int k) { return Measured{lens[k], std::sqrt(std::max(0.0, C(k, k)))}; };
  out.report.center_x = measured(kCenterX);
  out.report.center_y = measured(kCenterY);
  out.report.aspect = measured(kAspect);
  out.report.focal = measured(kFirstCoefficient);
  out.report.mapping_deviation_px = mapping_deviation(lens, C, region);
  out.report.covered = survey.covered;
  out.report.seen_from_px = survey.seen_from_px;
  out.report.seen_to_px = survey.seen_to_px;
  NODAL_TRY(check_determined(state.arrangement, out.report));
  for (std::size_t v = 0; v < photographs.size(); ++v) {
    const Pose& pose = state.arrangement.poses[v];
    ViewReport view;
    view.name = photographs[v].name;
    view.pairs = static_cast<int>(radial[v].inliers.size());
    view.tilt_deg = tilt_of(pose) / kRadiansPerDegree;
    view.distance = pose.t.dot(pose.R.col(2)) / pose.R(2, 2);
    view.blur_px = std::exp(state.log_blur[v]);
    view.covered = survey.fits[v].covered;
    view.explained = survey.fits[v].explained;
    view.rms = 255 * survey.fits[v].rms;
    out.report.views.push_back(view);
  }
  out.report.residuals = std::move(survey.residuals);
  fill_head(state, region, options, lumas[0].width, lumas[0].height, out.head);
  NODAL_TRY(cut_at_turning_point(lens, out));
  fill_photometry(survey.calm, out);
  add_notes(options, out.report);
  NODAL_TRY(check_head(out.head));
  tell("done", 1);
  return out;
}

namespace {

constexpr double kAxisTolerance = 0.01;  // share of the width: the lens's axis may be off the middle of the picture
constexpr double kMaxCornerRms = 0.002;  // share of the width
constexpr int kSeenCells = 10;           // each way, to see where corners are

/// Where corners are in the picture.
void note_seen(const std::vector<std::vector<PointPair>>& pairs, const LensParameters& lens, int width, int height,
               LensReport& report) {
  std::vector<bool> cells(std::size_t{kSeenCells} * kSeenCells);
  report.seen_from_px = 1e300;
  for (const auto& view : pairs) {
    for (const PointPair& pair : view) {
      const int i = std::clamp(static_cast<int>(kSeenCells * pair.photo.x() / width), 0, kSeenCells - 1);
      const int j = std::clamp(static_cast<int>(kSeenCells * pair.photo.y() / height), 0, kSeenCells - 1);
      cells[static_cast<std::size_t>(j * kSeenCells + i)] = true;
      const double r = std::hypot(pair.photo.x() - lens[kCenterX], (pair.photo.y() - lens[kCenterY]) / lens[kAspect]);
      report.seen_from_px = std::min(report.seen_from_px, r);
      report.seen_to_px = std::max(report.seen_to_px, r);
    }
  }
  report.covered = static_cast<double>(std::ranges::count(cells, true)) / static_cast<double>(cells.size());
}

}  // namespace

Result<LensCalibration> calibrate_on_corners(std::vector<CornerView> views, int width, int height,
                                             const LensOptions& options) {
  NODAL_TRY(check_count(views.size()));
  for (const CornerView& view : views) {
    if (view.corners.size() >= static_cast<std::size_t>(kMinPairs)) continue;
    return fail(Errc::kBadValue, fmt::format("{}: has {} corners; a photograph needs {} or more", view.name,
                                             view.corners.size(), kMinPairs));
  }
  const Eigen::Vector2d center(width / 2.0, height / 2.0);
  NODAL_TRY_ASSIGN(const auto radial, poses_of_boards(views, center, options.aspect, kAxisTolerance * width));
  NODAL_TRY_ASSIGN(Arrangement found, first_arrangement(radial, options.kind, center, options.aspect));
  const auto pairs = refine_start(radial, options.aspect_known, found);
  NODAL_TRY(check_views_differ(found.poses));
  const LensParameters& lens = found.lens;
  std::vector<bool> fixed(static_cast<std::size_t>(lens.count), false);
  fixed[kAspect] = options.aspect_known;
  const solve::Evaluation end = evaluated_on_points(found, pairs, 1);
  fixed.resize(static_cast<std::size_t>(end.equations.size()), false);
  const double freedom = std::max(1.0, static_cast<double>(end.equations.count() - end.equations.size()));
  const Eigen::MatrixXd C = end.equations.covariance(fixed) * (end.equations.cost() / freedom);

  LensCalibration out;
  const auto measured = [&](int k) { return Measured{lens[k], std::sqrt(std::max(0.0, C(k, k)))}; };
  out.report.center_x = measured(kCenterX);
  out.report.center_y = measured(kCenterY);
  out.report.aspect = measured(kAspect);
  out.report.focal = measured(kFirstCoefficient);
  const Region region{0, 0, static_cast<double>(width), static_cast<double>(height), {}};
  out.report.mapping_deviation_px = mapping_deviation(lens, C, region);
  note_seen(pairs, lens, width, height, out.report);
  NODAL_TRY(check_determined(found, out.report));
  for (std::size_t v = 0; v < views.size(); ++v) {
    Arrangement one{lens, {found.poses[v]}};
    const solve::Evaluation own = evaluated_on_points(one, {pairs[v]}, 1e9);
    ViewReport view;
    view.name = views[v].name;
    view.pairs = static_cast<int>(pairs[v].size());
    view.tilt_deg = tilt_of(found.poses[v]) / kRadiansPerDegree;
    view.distance = found.poses[v].t.dot(found.poses[v].R.col(2)) / found.poses[v].R(2, 2);
    view.rms_px = std::sqrt(own.equations.cost() / std::max<double>(1, static_cast<double>(pairs[v].size())));
    if (view.rms_px > kMaxCornerRms * width || 2 * pairs[v].size() < views[v].corners.size()) {
      return fail(Errc::kNotDetermined, fmt::format("{}: {} of {} corners fit, to {:.2f} px; another --model may "
                                                    "fit, or this board is not flat, or its corners are counted from "
                                                    "another end",
                                                    view.name, pairs[v].size(), views[v].corners.size(), view.rms_px));
    }
    out.report.views.push_back(view);
  }
  fill_head({found, {}}, region, options, width, height, out.head);
  out.head.response.curve = Response::Curve::kSrgb;
  out.head.vignetting = {out.head.center_x, out.head.center_y, std::hypot(width, height) / 2, {}};
  NODAL_TRY(cut_at_turning_point(lens, out));
  add_notes(options, out.report);
  NODAL_TRY(check_head(out.head));
  return out;
}

}  // namespace nodal::calibration
