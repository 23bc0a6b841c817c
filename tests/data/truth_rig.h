// Rendered test rigs with a known truth: a folder with rig_gt.json and a picture for each head.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "protocol/base/result.h"
#include "protocol/calibration.h"

namespace nodal::test_data {

/// The truth as a calibration, and the file name of each head's picture.
struct TruthRig {
  Calibration calibration;
  std::vector<std::string> images;
};

/// Parses rig_gt.json. Its pixel centres are at integers; its vignetting is v(r) = 1 + v2 p^2 + v4 p^4, p = r / 423,
/// with r from the lens's centre and the aspect divided out. Errors name the camera and the field.
Result<TruthRig> read_truth_rig(std::string_view json);

/// rig.toml for it, with replay heads for the pictures in `folder` (absolute), in `format` (RGB24, I420, ...).
std::string replay_rig_toml(const TruthRig& rig, std::string_view folder, std::string_view format, int width);

}  // namespace nodal::test_data
