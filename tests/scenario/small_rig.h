// A rig small enough to run thousands of virtual frames: six heads that look along the axes, and its calibration.
#pragma once

#include <string>

#include "firmware/config/config.h"
#include "protocol/calibration.h"

namespace nodal::scenario {

inline constexpr int kHeads = 6;
inline constexpr int kHeadSide = 64;

/// Six rectilinear heads of 110 degrees, forward, right, back, left, up, down: every ray is seen by one to three.
Calibration small_calibration(const std::string& name = "small");
/// "cam0" and so on, on "sim:cam0"; equirectangular RGB24 128 x 64.
firmware::RigConfig small_config();

}  // namespace nodal::scenario
