// A rig small enough for thousands of virtual frames: six heads that look along the axes, and its calibration.
#pragma once

#include <string>

#include "firmware/config/config.h"
#include "protocol/calibration.h"

namespace nodal::scenario {

inline constexpr int kHeads = 6;
inline constexpr int kHeadSide = 64;

/// Six rectilinear heads of 110 degrees: forward, right, back, left, up, down. Every ray is seen by one to three heads.
Calibration small_calibration(const std::string& name = "small");
/// Heads "cam0" and so on, at "sim:cam0" and so on; equirectangular RGB24 128 x 64.
firmware::RigConfig small_config();

}  // namespace nodal::scenario
