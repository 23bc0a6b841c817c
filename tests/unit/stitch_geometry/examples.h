// Lenses and heads of every kind, for the property tests.
#pragma once

#include <rapidcheck.h>
#include <cmath>
#include <numbers>
#include <string>
#include <utility>
#include <vector>

#include "protocol/calibration.h"
#include "stitch/geometry/rotation.h"

namespace nodal::geometry {

/// Figure 3's coefficients, with the focal length of a 97-degree horizontal field.
inline TsaiLens figure3_lens() { return {490, 2.29e-6, 1.65e-11}; }

inline std::vector<std::pair<std::string, LensModel>> every_kind_of_lens() {
  return {
      {"Figure 3", figure3_lens()},
      {"Tsai that turns", TsaiLens{400, -1.5e-6, 0}},
      {"plain pinhole", RectilinearLens{{500}}},
      {"rectilinear barrel that turns", RectilinearLens{{500, 0, -60}}},
      {"rectilinear with even powers", RectilinearLens{{500, 3, 10, 2}}},
      {"plain fisheye", EquidistantLens{{320}}},
      {"fisheye of 230 degrees", EquidistantLens{{440, 12, -9, -4}}},
      {"Kannala-Brandt", KannalaBrandtLens{285, {-0.0034, 0.0007, -0.0021, 0.0003}}},
      {"Kannala-Brandt, strong", KannalaBrandtLens{400, {0.08, -0.02, 0.004, -0.0003}}},
  };
}

inline double between(double low, double high) {
  return low + (high - low) * static_cast<double>(*rc::gen::arbitrary<std::uint32_t>()) / 4294967295.0;
}

inline HeadCalibration head_with(const LensModel& lens) {
  HeadCalibration head;
  head.name = "head";
  head.width = 720;
  head.height = 480;
  head.center_x = 362.3;
  head.center_y = 233.9;
  head.aspect = 1.083;
  head.lens = lens;
  head.R_head_rig = rows_of(to_R_head_rig({30, -20, 75}));
  // A region so small that every lens covers it, unless a test sets a larger one.
  head.region = {352, 224, 372, 244, {}};
  head.vignetting = {362.3, 233.9, 423, {-0.2, -0.08, 0}};
  return head;
}

}  // namespace nodal::geometry
