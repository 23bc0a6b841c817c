// Calibrations from other programs' files: Hugin's .pto, PTGui's text .pts, VideoStitch's .ptv, Surround360's
// JSON, OpenCV's and Kalibr's YAML, OCamCalib's text.
#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "protocol/base/result.h"
#include "protocol/calibration.h"
#include "stitch/geometry/ray.h"

namespace nodal::interchange {

/// One point of the scene in the pictures of two heads; pixels in Nodal's convention (a centre is at + 1/2).
struct ControlPoint {
  std::size_t head_a = 0;
  geometry::Pixel pixel_a;
  std::size_t head_b = 0;
  geometry::Pixel pixel_b;
};

/// An imported project. The calibration has passed check_calibration; `notes` are whole sentences for the user: what
/// could not be imported exactly, and what was assumed.
struct ImportResult {
  Calibration calibration;
  std::vector<std::string> notes;
  std::vector<ControlPoint> control_points;
  std::vector<std::string> images;  ///< each head's picture as named in the project; empty if not named
};

inline constexpr std::size_t kMaxProjectBytes = 8 << 20;  // a .pts contains masks, which are long

/// Pure functions of the text; `name` becomes the calibration's name.
/// Errors: kTooLarge, kTruncated, kBadFormat, kBadValue, kMissingField, with the line number or the field; kUnsupported
/// for a projection for which Nodal has no lens; those of check_calibration with the head's name.
Result<ImportResult> import_pto(std::string_view text, std::string_view name);
Result<ImportResult> import_pts(std::string_view text, std::string_view name);
Result<ImportResult> import_videostitch(std::string_view text, std::string_view name);
Result<ImportResult> import_surround360(std::string_view text, std::string_view name);
Result<ImportResult> import_kalibr(std::string_view text, std::string_view name);
/// One camera of OpenCV or OCamCalib.
Result<ImportResult> import_camera(std::string_view text, std::string_view name);

struct CameraFile {
  std::string path;
  std::string text;
};
/// A rig of such cameras, one per file, in the given order. The files hold no orientations: all cameras look forward,
/// with a note. Errors: as above, with the file's path; kUnsupported for too few or too many files.
Result<ImportResult> import_cameras(std::span<const CameraFile> files, std::string_view name);

/// Imports a project whose format is recognized from the text.
Result<ImportResult> import_project(std::string_view text, std::string_view name);

}  // namespace nodal::interchange
