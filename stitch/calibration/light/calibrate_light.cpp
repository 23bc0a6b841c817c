#include "stitch/calibration/light/calibrate_light.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <numeric>

#include "protocol/base/try.h"
#include "stitch/calibration/light/light_fit.h"
#include "stitch/geometry/held_light.h"

namespace nodal::calibration {
namespace {

constexpr double kStop = 0.69314718055994530942;  // ln 2
constexpr int kMinRays = 60;                      // rays that two heads must share to be compared
constexpr std::size_t kMinPlaces = 300;           // places per fit of a response; each has three channels
constexpr double kMinGamma = 0.3, kMaxGamma = 5;
constexpr double kLargeLeft = 0.3;     // stops
constexpr double kUnsureCorner = 0.1;  // stops

std::string text(double value, const char* format = "%.2f") {
  char buffer[48];
  std::snprintf(buffer, sizeof buffer, format, value);
  return buffer;
}

Status check_sets(const Calibration& prior, const std::vector<ExposedSet>& sets) {
  if (sets.empty()) return fail(Errc::kBadValue, "no pictures given; give one of every head, taken at one moment");
  for (const ExposedSet& set : sets) {
    if (set.frames.size() != prior.heads.size()) {
      return fail(Errc::kBadValue,
                  fmt::format("{}: holds {} pictures for {} heads", set.name, set.frames.size(), prior.heads.size()));
    }
    for (std::size_t h = 0; h < set.frames.size(); ++h) {
      const HeadCalibration& head = prior.heads[h];
      const ImageView& frame = set.frames[h];
      if (frame.format != PixelFormat::kRgb24) {
        return fail(Errc::kBadValue, set.name + ": the picture of head '" + head.name + "' is not RGB24");
      }
      if (frame.width == head.width && frame.height == head.height) continue;
      return fail(Errc::kBadValue,
                  fmt::format("{}: the picture of head '{}' is {}x{} px, but the calibration says {}x{}", set.name,
                              head.name, frame.width, frame.height, head.width, head.height));
    }
  }
  return {};
}

/// The largest set of heads that shared rays connect.
std::vector<bool> placed_heads(const LightGroups& groups, std::size_t heads) {
  std::vector<std::vector<int>> together(heads, std::vector<int>(heads, 0));
  for (std::size_t g = 0; g < groups.size(); ++g) {
    if (groups.all[groups.first[g]].channel != 0) continue;
    for (std::size_t i = groups.first[g]; i < groups.first[g + 1]; ++i) {
      for (std::size_t k = groups.first[g]; k < i; ++k) {
        const auto a = static_cast<std::size_t>(groups.all[i].head), b = static_cast<std::size_t>(groups.all[k].head);
        ++together[a][b];
        ++together[b][a];
      }
    }
  }
  std::vector<std::size_t> family(heads);
  std::iota(family.begin(), family.end(), std::size_t{0});
  for (std::size_t round = 0; round < heads; ++round) {
    for (std::size_t a = 0; a < heads; ++a) {
      for (std::size_t b = 0; b < heads; ++b) {
        if (together[a][b] >= kMinRays) family[a] = family[b] = std::min(family[a], family[b]);
      }
    }
  }
  std::size_t best = 0;
  for (std::size_t f = 1; f < heads; ++f) {
    if (std::ranges::count(family, f) > std::ranges::count(family, best)) best = f;
  }
  std::vector<bool> placed(heads);
  for (std::size_t h = 0; h < heads; ++h) placed[h] = family[h] == best;
  if (std::ranges::count(placed, true) < 2) placed.assign(heads, false);
  return placed;
}

/// Keeps the observations of the `wanted` heads, where at least two of them saw the light.
template <class Wanted>
LightGroups only(const LightGroups& groups, Wanted&& wanted) {
  LightGroups kept;
  for (std::size_t g = 0; g < groups.size(); ++g) {
    const std::size_t before = kept.all.size();
    for (std::size_t i = groups.first[g]; i < groups.first[g + 1]; ++i) {
      if (wanted(groups.all[i].head)) kept.all.push_back(groups.all[i]);
    }
    if (kept.all.size() < before + 2) kept.all.resize(before);
    else kept.first.push_back(kept.all.size());
  }
  return kept;
}

/// Whether the sets' stops determine a response. Errors: kBadValue when they are all equal.
Result<bool> stops_known(const std::vector<ExposedSet>& sets) {
  double least = HUGE_VAL, most = -HUGE_VAL;
  for (const ExposedSet& set : sets) {
    if (!set.stops) continue;
    least = std::min(least, *set.stops);
    most = std::max(most, *set.stops);
  }
  if (least > most) return false;
  if (most - least < 0.1) {
    return fail(Errc::kBadValue,
                "all stops are alike; a response needs the same scene under exposures that differ by "
                "a stop or more");
  }
  return true;
}

Status find_responses(const std::vector<geometry::Head>& heads, const std::vector<ExposedSet>& sets,
                      const LightOptions& options, LightModel& model, LightReport& report) {
  const LightGroups places = same_places(heads, sets);
  if (places.size() < 3 * kMinPlaces) {
    return fail(Errc::kNotDetermined, fmt::format("too few places are neither black nor clipped in two exposures ({}); "
                                                  "take the same scene a stop or two apart, and calm",
                                                  places.size() / 3));
  }
  const auto fitted = [&](const LightGroups& groups, const std::string& whose) -> Result<ResponseFit> {
    const ResponseFit fit = fit_response(groups);
    const bool gamma = fit.response.curve == Response::Curve::kGamma;
    if (gamma && !(fit.response.gamma >= kMinGamma && fit.response.gamma <= kMaxGamma)) {
      return fail(Errc::kNotDetermined, whose + " pictures do not follow the stops given (gamma would be " +
                                            text(fit.response.gamma) +
                                            "); check their signs and their order: +1 is twice the light");
    }
    return fit;
  };
  NODAL_TRY_ASSIGN(const ResponseFit all, fitted(places, "the"));
  report.response_found = true;
  report.sigma_gamma = all.sigma_gamma;
  report.response_left_stops = all.rms / kStop;
  for (Response& response : model.response) response = all.response;
  if (report.response_left_stops > kLargeLeft) {
    report.notes.push_back("the exposures disagree by " + text(report.response_left_stops) +
                           " stops rms: the scene changed between them, or the stops are not what the heads did");
  }
  if (!options.own_response) return {};
  for (std::size_t h = 0; h < heads.size(); ++h) {
    const LightGroups own = only(places, [h](int head) { return static_cast<std::size_t>(head) == h; });
    if (own.size() < 3 * kMinPlaces) {
      report.notes.push_back("head '" + heads[h].name() +
                             "' has too few good places for a response of its own and "
                             "takes the others'");
      continue;
    }
    NODAL_TRY_ASSIGN(const ResponseFit fit, fitted(own, "head '" + heads[h].name() + "': its"));
    model.response[h] = fit.response;
  }
  return {};
}

/// Writes the model into the calibration. A fall-off that check_head refuses is held at the limit, with a note.
void fill_heads(const LightModel& model, const std::vector<bool>& placed, LightReport& report) {
  for (std::size_t h = 0; h < report.calibration.heads.size(); ++h) {
    HeadCalibration& head = report.calibration.heads[h];
    head.response = model.response[h];
    if (!placed[h]) continue;
    for (std::size_t c = 0; c < 3; ++c) head.gain[c] = std::clamp(std::exp(model.log_gain[h][c]), 0.01, 100.0);
    head.vignetting = {head.center_x, head.center_y, fall_off_radius(head), model.vignetting[h]};
    if (!geometry::hold_light(head)) continue;
    report.notes.push_back("head '" + head.name +
                           "': its fall-off came out stronger than a calibration may have, and is held there");
  }
}

void fill_report(const LightGroups& groups, const LightModel& before, const LightFit& fit,
                 const std::vector<bool>& placed, LightReport& report) {
  const Disagreement was = disagreement(groups, before), is = disagreement(groups, fit.model);
  report.before_stops = was.rms / kStop;
  report.after_stops = is.rms / kStop;
  std::vector<int> shared(placed.size(), 0);
  for (const Observation& o : groups.all) shared[static_cast<std::size_t>(o.head)] += o.channel == 0 ? 1 : 0;
  for (std::size_t h = 0; h < placed.size(); ++h) {
    HeadLight head;
    head.name = report.calibration.heads[h].name;
    head.placed = placed[h];
    head.shared = shared[h];
    for (std::size_t c = 0; c < 3; ++c) {
      head.gain_stops[c] = fit.model.log_gain[h][c] / kStop;
      head.sigma_gain_stops[c] = placed[h] ? fit.sigma_log_gain[h][c] / kStop : 0;
    }
    const auto& v = fit.model.vignetting[h];
    head.corner_stops = -std::log2(std::max(1 + v[0] + v[1] + v[2], 1e-3));
    head.sigma_corner_stops = fit.sigma_corner[h] / kStop;
    head.before_stops = was.head_rms[h] / kStop;
    head.after_stops = is.head_rms[h] / kStop;
    if (!placed[h]) {
      report.notes.push_back("head '" + head.name +
                             "' shares too little with the others; its gain and fall-off stay "
                             "as they are");
    }
    report.heads.push_back(std::move(head));
  }
  const auto unsure = std::ranges::max_element(report.heads, {}, &HeadLight::sigma_corner_stops);
  if (unsure->sigma_corner_stops > kUnsureCorner) {
    report.notes.push_back("the overlaps say little about the fall-off (the corner is known to " +
                           text(unsure->sigma_corner_stops) + " stops); a lens calibration says more");
  }
  if (report.after_stops > kLargeLeft) {
    report.notes.push_back("shared rays still differ by " + text(report.after_stops) +
                           " stops rms: register the heads first, or take a scene that is farther away");
  }
}

}  // namespace

Result<LightReport> calibrate_light(const Calibration& prior, const std::vector<ExposedSet>& sets,
                                    const LightOptions& options) {
  NODAL_TRY(check_calibration(prior));
  NODAL_TRY(check_sets(prior, sets));
  NODAL_TRY_ASSIGN(const std::vector<geometry::Head> heads, geometry::make_heads(prior));
  LightReport report;
  report.calibration = prior;
  const LightModel before = model_of(prior);
  LightModel start = before;
  NODAL_TRY_ASSIGN(const bool known, stops_known(sets));
  if (known) {
    NODAL_TRY(find_responses(heads, sets, options, start, report));
  }
  const LightGroups all = shared_rays(heads, sets);
  const std::vector<bool> placed = placed_heads(all, prior.heads.size());
  if (std::ranges::count(placed, true) == 0) {
    return fail(Errc::kNoCoverage, fmt::format("no two heads share {} rays that are neither black nor clipped; check "
                                               "the calibration's rotations and the pictures' exposure",
                                               kMinRays));
  }
  const LightGroups groups = only(all, [&](int head) { return placed[static_cast<std::size_t>(head)] == true; });
  // A fall-off common to all heads needs a common start value.
  if (!options.own_vignetting) start.vignetting.assign(prior.heads.size(), {});
  const LightFit fit = fit_gains(groups, start, {placed, options.own_vignetting});
  fill_heads(fit.model, placed, report);
  fill_report(groups, before, fit, placed, report);
  NODAL_TRY(check_calibration(report.calibration));
  return report;
}

}  // namespace nodal::calibration
