// Calibrations from other programs' files: Hugin's .pto, PTGui's text .pts, VideoStitch's .ptv, Surround360's
// JSON, OpenCV's and Kalibr's YAML.
#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "protocol/base/result.h"
#include "protocol/calibration.h"
#include "stitch/geometry/ray.h"

namespace nodal::interchange {

/// One point of the scene in the pictures of two heads; pixels as Nodal counts them (a centre is at + 1/2).
struct ControlPoint {
  std::size_t head_a = 0;
  geometry::Pixel pixel_a;
  std::size_t head_b = 0;
  geometry::Pixel pixel_b;
};

/// An imported project. The calibration has passed check_calibration; `notes` are whole sentences for the user
/// about what did not fit or had to be guessed.
struct ImportResult {
  Calibration calibration;
  std::vector<std::string> notes;
  std::vector<ControlPoint> control_points;
  std::vector<std::string> images;  ///< each head's picture, as the project names it; empty when it names none
};

inline constexpr std::size_t kMaxProjectBytes = 8 << 20;  // masks inside a .pts are long

/// Pure functions of the text; `name` becomes the calibration's name.
/// Errors: kTooLarge, kTruncated, kBadFormat, kBadValue, kMissingField with the line's number or the field;
/// kUnsupported for a projection that Nodal has no lens for; those of check_calibration with the head's name.
Result<ImportResult> import_pto(std::string_view text, std::string_view name);
Result<ImportResult> import_pts(std::string_view text, std::string_view name);
Result<ImportResult> import_videostitch(std::string_view text, std::string_view name);
Result<ImportResult> import_surround360(std::string_view text, std::string_view name);
Result<ImportResult> import_opencv(std::string_view text, std::string_view name);
Result<ImportResult> import_kalibr(std::string_view text, std::string_view name);

struct CameraFile {
  std::string path;
  std::string text;
};
/// A rig of OpenCV cameras, one a file, in the order given. Their files do not say how they stand: all look forward, which
/// a note says. Errors: those above with the file's path; kUnsupported for fewer or more files than a rig has heads.
Result<ImportResult> import_opencv_cameras(std::span<const CameraFile> files, std::string_view name);

/// Recognizes the format by the text.
Result<ImportResult> import_project(std::string_view text, std::string_view name);

}  // namespace nodal::interchange
