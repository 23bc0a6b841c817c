// Estimates the heads' radiometry (§4.3): gain, fall-off and response, from the values that overlapping heads record
// for the same rays, and from pictures of the same scene under known exposures.
#pragma once

#include <array>
#include <string>
#include <vector>

#include "protocol/base/result.h"
#include "protocol/calibration.h"
#include "stitch/calibration/light/light_samples.h"

namespace nodal::calibration {

struct LightOptions {
  bool own_vignetting = false;  ///< one fall-off per head, instead of one for all
  bool own_response = false;    ///< one curve per head, instead of one for all
};

struct HeadLight {
  std::string name;
  bool placed = true;                        ///< false: it shares too few rays with others, and keeps its gain
  int shared = 0;                            ///< rays it shares, over all sets
  std::array<double, 3> gain_stops{};        ///< red, green, blue, relative to the rig's mean
  std::array<double, 3> sigma_gain_stops{};  ///< standard deviation
  double corner_stops = 0;                   ///< light lost in the corner of its picture
  double sigma_corner_stops = 0;
  double before_stops = 0;  ///< rms difference from the others' light, with the prior
  double after_stops = 0;
};

struct LightReport {
  Calibration calibration;  ///< the prior with the new values; checked
  std::vector<HeadLight> heads;
  bool response_found = false;
  double sigma_gamma = 0;                    ///< standard deviation of a gamma; 0 for a polynomial
  double response_left_stops = 0;            ///< rms of the residuals between exposures
  double before_stops = 0, after_stops = 0;  ///< rms over all shared rays
  std::vector<std::string> notes;            ///< remarks for the user, one sentence each
};

/// Gains and fall-off come from the overlaps. The response needs sets with at least two different known stops, because
/// overlaps alone also fit a steeper curve with larger gains; without such sets it keeps the prior's value.
///
/// Threading: thread-safe.
/// Ownership: the frames' bytes must stay valid during the call.
/// Errors: kBadValue, naming set and head, for frames that are not RGB24 or not of the head's size, and for stops that
/// are all equal; kNoCoverage if no two heads share rays; kNotDetermined if the pictures contradict the stops.
Result<LightReport> calibrate_light(const Calibration& prior, const std::vector<ExposedSet>& sets,
                                    const LightOptions& options);

}  // namespace nodal::calibration
