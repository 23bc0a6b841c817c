// Small rigs with known numbers, for tests that need any calibration.
#pragma once

#include <cmath>
#include <numbers>
#include <string>

#include "protocol/calibration.h"

namespace nodal::test {

/// A level head that looks along `yaw` (to the right), without distortion, vignetting or gain.
inline HeadCalibration plain_head(const std::string& name, int width, int height, double yaw_deg = 0,
                                  double horizontal_view_deg = 90) {
  HeadCalibration head;
  head.name = name;
  head.width = width;
  head.height = height;
  head.center_x = width / 2.0;
  head.center_y = height / 2.0;
  head.lens = RectilinearLens{{width / 2.0 / std::tan(horizontal_view_deg * std::numbers::pi / 360)}};
  head.region = {0, 0, static_cast<double>(width), static_cast<double>(height), {}};
  head.vignetting = {width / 2.0, height / 2.0, width / 2.0, {}};
  const double c = std::cos(yaw_deg * std::numbers::pi / 180);
  const double s = std::sin(yaw_deg * std::numbers::pi / 180);
  head.R_head_rig = {c, 0, -s, 0, 1, 0, s, 0, c};
  return head;
}

/// n plain heads, "cam0" and so on, evenly spaced around the horizon.
inline Calibration ring(int heads, int width, int height) {
  Calibration rig;
  rig.name = "ring";
  for (int i = 0; i < heads; ++i) {
    rig.heads.push_back(plain_head("cam" + std::to_string(i), width, height, 360.0 * i / heads));
  }
  return rig;
}

}  // namespace nodal::test
