// Documents on which the calibration tests are based.
#pragma once

#include <string>

#include "protocol/calibration.h"

namespace nodal {

/// The lens of the paper's Figure 3 with an NTSC picture.
inline HeadCalibration figure3_head() {
  HeadCalibration head;
  head.name = "cam5";
  head.width = 720;
  head.height = 480;
  head.center_x = 360.8;
  head.center_y = 224.6;
  head.aspect = 1.083;
  head.lens = TsaiLens{490.0, 2.29e-6, 1.65e-11};
  head.region = {0, 0, 720, 480, {}};
  head.vignetting = {360.8, 224.6, 423, {-0.2, -0.08, 0}};
  head.gain = {1.05, 1.0, 0.95};
  return head;
}

inline HeadCalibration fisheye_head() {
  HeadCalibration head;
  head.name = "fisheye";
  head.width = 1568;
  head.height = 1504;
  head.center_x = 784;
  head.center_y = 752;
  head.lens = EquidistantLens{{440.0, 0.0, -3.0}};
  head.max_angle = 1.7;
  head.R_head_rig = {0, 0, -1, 0, 1, 0, 1, 0, 0};
  head.region = {4, 0, 1560, 1504, Region::Circle{784, 752, 745}};
  head.response.curve = Response::Curve::kSrgb;
  head.vignetting = {784, 752, 752, {0, 0, 0}};
  return head;
}

inline Calibration two_heads() { return {"test rig", "made for tests", {figure3_head(), fisheye_head()}}; }

/// `text` with its only occurrence of `from` replaced by `to`.
inline std::string replaced(std::string text, const std::string& from, const std::string& to) {
  const std::size_t at = text.find(from);
  if (at == std::string::npos) return "replaced(): not found: " + from;
  return text.replace(at, from.size(), to);
}

}  // namespace nodal
